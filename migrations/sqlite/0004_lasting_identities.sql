-- Identities that last: numbers that are never used twice, content hashes that say by which
-- recipe they were made, and enrolments that can be repeated after a lost answer.

DROP VIEW stored_trial;

-- AUTOINCREMENT: a number in an address, a list's cursor or a job's name must not come back as
-- something else after a row was deleted.
CREATE TABLE new_trial (
    -- In the order of arrival: lists page by it.
    sequence INTEGER PRIMARY KEY AUTOINCREMENT,
    -- One trial a scene: of a hundred parallel uploads exactly one row stays.
    trial_id TEXT NOT NULL UNIQUE REFERENCES scene (trial_id),
    -- The participant's study, repeated here so that a list reads no more rows than it shows.
    study_id INTEGER NOT NULL REFERENCES study (id),
    -- By which recipe the content was hashed: 1 uploads as JSON, 2 trials of files as bytes. A
    -- recipe is never changed; a field that needs another one gets the next number.
    content_version INTEGER NOT NULL CHECK (content_version >= 1),
    -- SHA-256 of the content, which tells the same upload again from a different one.
    content_hash BLOB NOT NULL CHECK (length(content_hash) = 32),
    received_at_ms INTEGER NOT NULL,
    -- The participant's clock. NULL for trials read from a file that does not say.
    started_at_ms REAL,
    -- One signed byte a step: -1 right, 0 straight, 1 left.
    inputs BLOB NOT NULL,
    -- Six little-endian doubles a state (human x, y, psi, robot x, y, psi): bit for bit as sent.
    states BLOB NOT NULL,
    -- One little-endian double a step. NULL for trials read from a file that does not say.
    sampled_at_ms BLOB,
    key_events TEXT NOT NULL,
    display TEXT NOT NULL,
    -- Words joined by semicolons. Evidence about a trial never changes or refuses it.
    flags TEXT NOT NULL,
    closest_m REAL NOT NULL,
    first_step_in_danger INTEGER,
    avoidance_first INTEGER,
    avoidance_last INTEGER,
    CHECK (length(states) = 48 * (length(inputs) + 1)),
    CHECK (sampled_at_ms IS NULL OR length(sampled_at_ms) = 8 * length(inputs)),
    CHECK ((avoidance_first IS NULL) = (avoidance_last IS NULL))
) STRICT;

INSERT INTO new_trial
SELECT trial.sequence, trial.trial_id, participant.study_id,
       CASE WHEN ';' || trial.flags || ';' LIKE '%;imported;%' THEN 2 ELSE 1 END,
       trial.content_hash, trial.received_at_ms, trial.started_at_ms, trial.inputs, trial.states,
       trial.sampled_at_ms, trial.key_events, trial.display, trial.flags, trial.closest_m,
       trial.first_step_in_danger, trial.avoidance_first, trial.avoidance_last
FROM trial
JOIN scene ON scene.trial_id = trial.trial_id
JOIN participant ON participant.id = scene.participant_id
ORDER BY trial.sequence;

DROP TABLE trial;
ALTER TABLE new_trial RENAME TO trial;
CREATE INDEX trial_of_study ON trial (study_id, sequence);

CREATE VIEW stored_trial AS
SELECT trial.sequence, trial.trial_id, trial.content_version, trial.content_hash,
       trial.received_at_ms, trial.started_at_ms,
       trial.inputs, trial.states, trial.sampled_at_ms, trial.key_events, trial.display, trial.flags,
       trial.closest_m, trial.first_step_in_danger, trial.avoidance_first, trial.avoidance_last,
       scene.ordinal, scene.phase, scene.idx,
       scene.human_x, scene.human_y, scene.human_psi,
       scene.robot_x, scene.robot_y, scene.robot_psi, scene.goal_x, scene.goal_y,
       participant.id AS participant_id, participant.number AS participant_number,
       trial.study_id, participant.config_hash,
       study.slug AS study
FROM trial
JOIN scene ON scene.trial_id = trial.trial_id
JOIN participant ON participant.id = scene.participant_id
JOIN study ON study.id = trial.study_id;

CREATE TABLE new_analysis (
    -- In the order of asking: they are made in it, and lists page by it. With the attempt it names
    -- a job, which must never be taken for a later one.
    sequence INTEGER PRIMARY KEY AUTOINCREMENT,
    id TEXT NOT NULL UNIQUE,
    study_id INTEGER NOT NULL REFERENCES study (id),
    -- What was asked for, as JSON.
    request TEXT NOT NULL,
    state TEXT NOT NULL CHECK
        (state IN ('queued', 'running', 'done', 'failed', 'cancelled', 'withdrawn')),
    -- How often it was begun without coming to an end: what brings the server down is not begun
    -- for ever.
    attempts INTEGER NOT NULL DEFAULT 0 CHECK (attempts >= 0),
    -- Pieces of work.
    done INTEGER NOT NULL DEFAULT 0,
    total INTEGER NOT NULL DEFAULT 0,
    -- Those of the done ones that were not kept from before: they tell how long the rest takes.
    fresh INTEGER NOT NULL DEFAULT 0,
    created_at_ms INTEGER NOT NULL,
    started_at_ms INTEGER,
    ended_at_ms INTEGER,
    -- Why it failed.
    message TEXT,
    -- What it is about, as JSON.
    result TEXT,
    CHECK ((state IN ('queued', 'running')) = (ended_at_ms IS NULL)),
    CHECK ((state = 'done') = (result IS NOT NULL)),
    CHECK ((state = 'failed') = (message IS NOT NULL))
) STRICT;

INSERT INTO new_analysis
SELECT sequence, id, study_id, request, state, attempts, done, total, fresh, created_at_ms,
       started_at_ms, ended_at_ms, message, result
FROM analysis ORDER BY sequence;

DROP TABLE analysis;
ALTER TABLE new_analysis RENAME TO analysis;
CREATE INDEX analysis_of_study ON analysis (study_id, sequence);

-- A long file is written in parts, each in a transaction of its own, so that no upload waits
-- for a whole one.
CREATE TABLE new_analysis_file (
    analysis INTEGER NOT NULL REFERENCES analysis (sequence) ON DELETE CASCADE,
    name TEXT NOT NULL,
    part INTEGER NOT NULL CHECK (part >= 0),
    -- Length of the whole file before compression.
    size INTEGER NOT NULL CHECK (size >= 0),
    -- Compressed with gzip: predictions and models are long, and much the same.
    bytes BLOB NOT NULL,
    PRIMARY KEY (analysis, name, part)
) STRICT;

INSERT INTO new_analysis_file SELECT analysis, name, 0, size, octets FROM analysis_file;
DROP TABLE analysis_file;
ALTER TABLE new_analysis_file RENAME TO analysis_file;

-- SHA-256 of the name that a client gave to its enrolment. Whoever repeats an enrolment because
-- the answer was lost is the same participant. NULL where no name was given or it was deleted.
ALTER TABLE participant ADD COLUMN request_hash BLOB
    CHECK (request_hash IS NULL OR length(request_hash) = 32);
CREATE UNIQUE INDEX participant_of_request ON participant (study_id, request_hash);
