-- Studies, the people in them, what they are to drive and what they drove.
-- Times are milliseconds since 1970 by the server's clock unless a name says otherwise.
-- STRICT: a column holds what it says or the statement fails.

CREATE TABLE study (
    id INTEGER PRIMARY KEY,
    -- Addresses name a study by its slug, so there can be only one of a name.
    slug TEXT NOT NULL UNIQUE,
    -- The configuration that new participants get.
    config_hash TEXT NOT NULL REFERENCES study_config (hash),
    created_at_ms INTEGER NOT NULL
) STRICT;

-- Configurations are kept for ever: each participant points at the one that they were enrolled
-- under, so an edited study file never changes what an earlier trial meant.
CREATE TABLE study_config (
    -- SHA-256 of the content: the same configuration is stored once.
    hash TEXT PRIMARY KEY,
    json TEXT NOT NULL
) STRICT;

CREATE TABLE participant (
    id TEXT PRIMARY KEY,
    study_id INTEGER NOT NULL REFERENCES study (id),
    -- What analysts see instead of the id; from 1 within the study.
    number INTEGER NOT NULL CHECK (number >= 1),
    -- The recruiting service's name for the person. NULL where there is none or it was deleted.
    external_id TEXT,
    config_hash TEXT NOT NULL REFERENCES study_config (hash),
    -- Seed of the scenes (the bits of an unsigned number). NULL for people read from a file.
    seed INTEGER,
    -- SHA-256 of what was read from a file. NULL for people who enrolled.
    import_hash TEXT,
    locale TEXT,
    screen TEXT,
    enrolled_at_ms INTEGER NOT NULL,
    completed_at_ms INTEGER,
    completion_code TEXT,
    withdrawn_at_ms INTEGER,
    data_deleted INTEGER NOT NULL DEFAULT 0 CHECK (data_deleted IN (0, 1)),
    UNIQUE (study_id, number),
    -- Two tabs that enrol the same person at once get one participant.
    UNIQUE (study_id, external_id),
    -- Importing a file twice must not double its people.
    UNIQUE (study_id, import_hash),
    -- A code proves a completion; one without the other would be a lie.
    CHECK ((completion_code IS NULL) = (completed_at_ms IS NULL)),
    -- What was asked to be deleted is gone, and only who withdrew can ask.
    CHECK (data_deleted = 0 OR (withdrawn_at_ms IS NOT NULL AND external_id IS NULL
                                AND locale IS NULL AND screen IS NULL))
) STRICT;

-- Several tokens may be valid at once: resuming on another machine must not strand trials that
-- wait in the first one's outbox. Only hashes are stored; a stolen file opens nothing.
CREATE TABLE participant_token (
    hash BLOB PRIMARY KEY CHECK (length(hash) = 32),
    participant_id TEXT NOT NULL REFERENCES participant (id),
    created_at_ms INTEGER NOT NULL
) STRICT;

-- What a participant is to drive. Written at enrolment, so that a plan survives every later
-- change of the code that draws scenes.
CREATE TABLE scene (
    trial_id TEXT PRIMARY KEY,
    participant_id TEXT NOT NULL REFERENCES participant (id),
    -- Place in the whole plan, from 0.
    ordinal INTEGER NOT NULL CHECK (ordinal >= 0),
    phase TEXT NOT NULL CHECK (phase IN ('familiarisation', 'practice', 'task')),
    -- Place within the phase, from 0.
    idx INTEGER NOT NULL CHECK (idx >= 0),
    human_x REAL NOT NULL, human_y REAL NOT NULL, human_psi REAL NOT NULL,
    robot_x REAL NOT NULL, robot_y REAL NOT NULL, robot_psi REAL NOT NULL,
    goal_x REAL NOT NULL, goal_y REAL NOT NULL,
    UNIQUE (participant_id, ordinal),
    UNIQUE (participant_id, phase, idx)
) STRICT;

CREATE TABLE trial (
    -- In the order of arrival: lists page by it.
    sequence INTEGER PRIMARY KEY,
    -- One trial a scene: of a hundred parallel uploads exactly one row stays.
    trial_id TEXT NOT NULL UNIQUE REFERENCES scene (trial_id),
    -- SHA-256 of the content, which tells the same upload again from a different one.
    content_hash BLOB NOT NULL CHECK (length(content_hash) = 32),
    received_at_ms INTEGER NOT NULL,
    -- The participant's clock. NULL for trials read from a file that does not say.
    started_at_ms REAL,
    -- One signed octet a step: -1 right, 0 straight, 1 left.
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

-- Octets by the SHA-256 of their content, for browsers that draw safety levels.
CREATE TABLE value_function (
    id TEXT PRIMARY KEY CHECK (length(id) = 64),
    octets BLOB NOT NULL
) STRICT;

-- The experimenter's key (its hash) and who is signed in (hashes of random cookies).
CREATE TABLE admin_key (
    hash BLOB PRIMARY KEY CHECK (length(hash) = 32),
    created_at_ms INTEGER NOT NULL
) STRICT;

CREATE TABLE session (
    hash BLOB PRIMARY KEY CHECK (length(hash) = 32),
    expires_at_ms INTEGER NOT NULL
) STRICT;

-- A stored trial with where it belongs: what replay, export and training read.
CREATE VIEW stored_trial AS
SELECT trial.sequence, trial.trial_id, trial.content_hash, trial.received_at_ms, trial.started_at_ms,
       trial.inputs, trial.states, trial.sampled_at_ms, trial.key_events, trial.display, trial.flags,
       trial.closest_m, trial.first_step_in_danger, trial.avoidance_first, trial.avoidance_last,
       scene.ordinal, scene.phase, scene.idx,
       scene.human_x, scene.human_y, scene.human_psi,
       scene.robot_x, scene.robot_y, scene.robot_psi, scene.goal_x, scene.goal_y,
       participant.id AS participant_id, participant.number AS participant_number,
       participant.study_id, participant.config_hash,
       study.slug AS study
FROM trial
JOIN scene ON scene.trial_id = trial.trial_id
JOIN participant ON participant.id = scene.participant_id
JOIN study ON study.id = participant.study_id;
