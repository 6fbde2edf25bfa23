-- Places in a study, what a token may do, further attempts at a scene, and what participants agreed
-- to, understood and answered.

DROP VIEW stored_trial;

CREATE TABLE new_participant (
    id TEXT PRIMARY KEY,
    study_id INTEGER NOT NULL REFERENCES study (id),
    -- A pilot's data are kept apart: no list, count, export or analysis has them.
    pilot INTEGER NOT NULL DEFAULT 0 CHECK (pilot IN (0, 1)),
    -- What analysts see instead of the id; from 1 within the study. Pilots have numbers of their own.
    number INTEGER NOT NULL CHECK (number >= 1),
    -- The participant's place in the study's design, from 0: it decides which scenes they drive. That of
    -- a pilot is drawn at random. NULL for people read from a file, and for those who enrolled before
    -- there were places.
    place INTEGER CHECK (place >= 0),
    -- Whether the place is taken. It becomes free when its holder withdraws or is screened out, or
    -- stays away while others wait for a place of the quota.
    holds_place INTEGER NOT NULL DEFAULT 0 CHECK (holds_place IN (0, 1)),
    -- The recruiting service's name for the person, as it came. NULL where there is none or it was
    -- deleted.
    external_id TEXT,
    -- The same without white space around it and in lower case: one person, one key. NULL for pilots.
    external_key TEXT,
    -- SHA-256 of the name that a client gave to its enrolment. Whoever repeats an enrolment because
    -- the answer was lost is the same participant. NULL where no name was given or it was deleted.
    request_hash BLOB CHECK (request_hash IS NULL OR length(request_hash) = 32),
    config_hash TEXT NOT NULL REFERENCES study_config (hash),
    -- Seed of the scenes of those who enrolled before there were places (the bits of an unsigned
    -- number); NULL for all others.
    seed INTEGER,
    -- SHA-256 of what was read from a file. NULL for people who enrolled.
    import_hash TEXT,
    locale TEXT,
    screen TEXT,
    -- Parameters of the address that the study records, as a JSON object. NULL if there are none.
    parameters TEXT,
    -- The language in which the participant read what they agreed to, and the SHA-256 of what they
    -- read. NULL if the enrolment named no language.
    consent_language TEXT,
    consent_hash TEXT,
    enrolled_at_ms INTEGER NOT NULL,
    -- The last write of this participant: whoever stays away loses their place of the quota.
    last_seen_at_ms INTEGER NOT NULL,
    -- How often the check of understanding was answered, and when it was passed.
    comprehension_attempts INTEGER NOT NULL DEFAULT 0 CHECK (comprehension_attempts >= 0),
    understood_at_ms INTEGER,
    screened_out_at_ms INTEGER,
    -- Answers to the study's questions, as a JSON object.
    answers TEXT,
    answered_at_ms INTEGER,
    completed_at_ms INTEGER,
    completion_code TEXT,
    withdrawn_at_ms INTEGER,
    data_deleted INTEGER NOT NULL DEFAULT 0 CHECK (data_deleted IN (0, 1)),
    UNIQUE (study_id, pilot, number),
    -- Two tabs that enrol the same person at once get one participant.
    UNIQUE (study_id, external_key),
    -- Importing a file twice must not double its people.
    UNIQUE (study_id, import_hash),
    UNIQUE (study_id, request_hash),
    CHECK (holds_place = 0 OR place IS NOT NULL),
    CHECK (pilot = 0 OR (holds_place = 0 AND external_key IS NULL)),
    -- A code proves a completion; one without the other would be a lie.
    CHECK ((completion_code IS NULL) = (completed_at_ms IS NULL)),
    CHECK ((answers IS NULL) = (answered_at_ms IS NULL)),
    -- What was asked to be deleted is gone, and only who withdrew can ask.
    CHECK (data_deleted = 0 OR (withdrawn_at_ms IS NOT NULL AND external_id IS NULL
                                AND external_key IS NULL AND request_hash IS NULL
                                AND locale IS NULL AND screen IS NULL AND parameters IS NULL
                                AND consent_language IS NULL AND consent_hash IS NULL
                                AND place IS NULL AND seed IS NULL AND answers IS NULL
                                AND completion_code IS NULL))
) STRICT;

-- Of several ids that are one person now, the first keeps the person's key.
INSERT INTO new_participant (id, study_id, number, external_id, external_key, request_hash,
    config_hash, seed, import_hash, locale, screen, enrolled_at_ms, last_seen_at_ms,
    completed_at_ms, completion_code, withdrawn_at_ms, data_deleted)
SELECT id, study_id, number, external_id,
    CASE WHEN NOT EXISTS (SELECT 1 FROM participant AS earlier
                          WHERE earlier.study_id = participant.study_id
                            AND earlier.number < participant.number
                            AND lower(trim(earlier.external_id)) = lower(trim(participant.external_id)))
         THEN lower(trim(external_id)) END,
    request_hash, config_hash, seed, import_hash, locale, screen, enrolled_at_ms,
    max(enrolled_at_ms, coalesce(completed_at_ms, 0),
        coalesce((SELECT max(received_at_ms) FROM trial JOIN scene ON scene.trial_id = trial.trial_id
                  WHERE scene.participant_id = participant.id), 0)),
    iif(data_deleted, NULL, completed_at_ms), iif(data_deleted, NULL, completion_code),
    withdrawn_at_ms, data_deleted
FROM participant;

DROP TABLE participant;
ALTER TABLE new_participant RENAME TO participant;

-- One holder a place, and the lowest free place is found without reading the participants.
CREATE UNIQUE INDEX place_of_study ON participant (study_id, place) WHERE holds_place = 1;

-- What a token may do. 'full': everything, as the browser that enrolled. 'continue': go on with the
-- study, for somebody who knew only the external id. Earlier tokens are full: whoever has one keeps
-- their rights.
ALTER TABLE participant_token ADD COLUMN scope TEXT NOT NULL DEFAULT 'full'
    CHECK (scope IN ('full', 'continue'));
-- Whether the participation was completed with this token: its holder has seen the code.
ALTER TABLE participant_token ADD COLUMN completed INTEGER NOT NULL DEFAULT 0
    CHECK (completed IN (0, 1));

-- What a participant is to drive. Written once, when they enrol, so that a plan survives every later
-- change of the code that draws scenes; a scene whose trial was interrupted may be added again.
CREATE TABLE new_scene (
    trial_id TEXT PRIMARY KEY,
    participant_id TEXT NOT NULL REFERENCES participant (id),
    -- Place in the whole plan, from 0.
    ordinal INTEGER NOT NULL CHECK (ordinal >= 0),
    phase TEXT NOT NULL CHECK (phase IN ('familiarisation', 'practice', 'task')),
    -- Place within the phase, from 0.
    idx INTEGER NOT NULL CHECK (idx >= 0),
    -- From 1; 2 is the scene again after an interrupted trial.
    attempt INTEGER NOT NULL DEFAULT 1 CHECK (attempt >= 1),
    human_x REAL NOT NULL, human_y REAL NOT NULL, human_psi REAL NOT NULL,
    robot_x REAL NOT NULL, robot_y REAL NOT NULL, robot_psi REAL NOT NULL,
    goal_x REAL NOT NULL, goal_y REAL NOT NULL,
    UNIQUE (participant_id, ordinal),
    UNIQUE (participant_id, phase, idx, attempt)
) STRICT;

INSERT INTO new_scene (trial_id, participant_id, ordinal, phase, idx, human_x, human_y, human_psi,
    robot_x, robot_y, robot_psi, goal_x, goal_y)
SELECT trial_id, participant_id, ordinal, phase, idx, human_x, human_y, human_psi,
    robot_x, robot_y, robot_psi, goal_x, goal_y
FROM scene;

DROP TABLE scene;
ALTER TABLE new_scene RENAME TO scene;

-- What happened to the page during the scene, as a JSON list, and how often the scene was shown. NULL
-- where it was not recorded: in trials of earlier versions and of files.
ALTER TABLE trial ADD COLUMN page_events TEXT;
ALTER TABLE trial ADD COLUMN exposures INTEGER CHECK (exposures >= 1);

CREATE VIEW stored_trial AS
SELECT trial.sequence, trial.trial_id, trial.content_version, trial.content_hash,
       trial.received_at_ms, trial.started_at_ms,
       trial.inputs, trial.states, trial.sampled_at_ms, trial.key_events, trial.page_events,
       trial.exposures, trial.display, trial.flags,
       trial.closest_m, trial.first_step_in_danger, trial.avoidance_first, trial.avoidance_last,
       scene.ordinal, scene.phase, scene.idx, scene.attempt,
       scene.human_x, scene.human_y, scene.human_psi,
       scene.robot_x, scene.robot_y, scene.robot_psi, scene.goal_x, scene.goal_y,
       participant.id AS participant_id, participant.number AS participant_number,
       participant.pilot,
       trial.study_id, participant.config_hash,
       study.slug AS study
FROM trial
JOIN scene ON scene.trial_id = trial.trial_id
JOIN participant ON participant.id = scene.participant_id
JOIN study ON study.id = trial.study_id;
