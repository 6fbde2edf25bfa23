-- The list of participants is filtered, sorted and counted from one narrow row a participant, whatever
-- the study's size: their tally, from enrolment on, with copies of what the list needs to know of the
-- participant. Triggers keep the copies; the stage follows in one place, here.

CREATE TABLE new_tally (
    -- Of the participant; the list is in this order.
    study_id INTEGER NOT NULL,
    pilot INTEGER NOT NULL,
    number INTEGER NOT NULL,
    participant_id TEXT NOT NULL UNIQUE REFERENCES participant (id) ON DELETE CASCADE,
    last_seen_at_ms INTEGER NOT NULL,
    comprehension_attempts INTEGER NOT NULL,
    understood INTEGER NOT NULL,
    withdrawn INTEGER NOT NULL,
    screened_out INTEGER NOT NULL,
    complete INTEGER NOT NULL,
    imported INTEGER NOT NULL,
    -- Whether analyses leave the participant out.
    excluded INTEGER NOT NULL DEFAULT 0,

    -- Counted from the stored trials, in the transaction that stores one.
    -- The phase of the scene that comes next; NULL after the last, and before the first trial.
    next_phase TEXT,
    -- Stored trials by phase, further attempts too.
    familiarisation INTEGER NOT NULL DEFAULT 0,
    practice INTEGER NOT NULL DEFAULT 0,
    task INTEGER NOT NULL DEFAULT 0,
    -- Tasks with such a flag, first and further attempts.
    late_sample INTEGER NOT NULL DEFAULT 0,
    focus_lost INTEGER NOT NULL DEFAULT 0,
    interrupted INTEGER NOT NULL DEFAULT 0,
    -- Tasks without a turn; with a turn in each step; in which the human entered the danger zone; with the
    -- key times of an earlier trial of the study.
    never_steered INTEGER NOT NULL DEFAULT 0,
    always_steered INTEGER NOT NULL DEFAULT 0,
    danger_entered INTEGER NOT NULL DEFAULT 0,
    same_timing INTEGER NOT NULL DEFAULT 0,
    -- Trials that waited in the browser when the last one was stored.
    waiting INTEGER NOT NULL DEFAULT 0,

    stored INTEGER NOT NULL GENERATED ALWAYS AS (familiarisation + practice + task) STORED,
    -- Wrong answers to the check of understanding.
    failed_checks INTEGER NOT NULL GENERATED ALWAYS AS (max(0, comprehension_attempts - understood)) STORED,
    -- Whether an experimenter should look at what the participant did, and has not excluded them: no task
    -- was steered, each was steered throughout, or keys have the times of an earlier trial.
    doubtful INTEGER NOT NULL GENERATED ALWAYS AS
        (task > 0 AND NOT excluded
         AND (same_timing > 0 OR never_steered = task OR always_steered = task)) STORED,
    stage TEXT NOT NULL GENERATED ALWAYS AS (CASE
        WHEN withdrawn THEN 'withdrawn'
        WHEN screened_out THEN 'screened_out'
        WHEN complete THEN 'complete'
        WHEN imported THEN 'imported'
        WHEN familiarisation + practice + task = 0 THEN 'joined'
        ELSE coalesce(next_phase, 'closing') END) STORED,
    PRIMARY KEY (study_id, pilot, number)
) STRICT, WITHOUT ROWID;

INSERT INTO new_tally (study_id, pilot, number, participant_id, last_seen_at_ms, comprehension_attempts,
    understood, withdrawn, screened_out, complete, imported, excluded, next_phase, familiarisation, practice,
    task, late_sample, focus_lost, interrupted, never_steered, always_steered, danger_entered, same_timing,
    waiting)
SELECT study_id, pilot, number, id, last_seen_at_ms, comprehension_attempts, understood_at_ms IS NOT NULL,
    withdrawn_at_ms IS NOT NULL, screened_out_at_ms IS NOT NULL, completion_code IS NOT NULL,
    import_hash IS NOT NULL,
    EXISTS (SELECT 1 FROM exclusion WHERE exclusion.participant_id = id AND ended_at_ms IS NULL),
    next_phase, coalesce(familiarisation, 0), coalesce(practice, 0), coalesce(task, 0),
    coalesce(late_sample, 0), coalesce(focus_lost, 0), coalesce(interrupted, 0), coalesce(never_steered, 0),
    coalesce(always_steered, 0), coalesce(danger_entered, 0), coalesce(same_timing, 0), coalesce(waiting, 0)
FROM participant LEFT JOIN tally ON tally.participant_id = participant.id;

DROP TABLE tally;
ALTER TABLE new_tally RENAME TO tally;
DROP INDEX people;

-- How many are at each stage.
CREATE INDEX tally_at_stage ON tally (study_id, pilot, stage);
-- A search for one participant.
CREATE INDEX participant_called ON participant (study_id, pilot, lower(external_id))
    WHERE external_id IS NOT NULL;
CREATE INDEX participant_with_code ON participant (study_id, pilot, lower(completion_code))
    WHERE completion_code IS NOT NULL;

CREATE TRIGGER tally_begins AFTER INSERT ON participant BEGIN
    INSERT INTO tally (study_id, pilot, number, participant_id, last_seen_at_ms, comprehension_attempts,
        understood, withdrawn, screened_out, complete, imported)
    VALUES (NEW.study_id, NEW.pilot, NEW.number, NEW.id, NEW.last_seen_at_ms, NEW.comprehension_attempts,
        NEW.understood_at_ms IS NOT NULL, NEW.withdrawn_at_ms IS NOT NULL,
        NEW.screened_out_at_ms IS NOT NULL, NEW.completion_code IS NOT NULL, NEW.import_hash IS NOT NULL);
END;

CREATE TRIGGER tally_follows AFTER UPDATE OF last_seen_at_ms, comprehension_attempts, understood_at_ms,
    withdrawn_at_ms, screened_out_at_ms, completion_code, import_hash ON participant BEGIN
    UPDATE tally SET last_seen_at_ms = NEW.last_seen_at_ms,
        comprehension_attempts = NEW.comprehension_attempts,
        understood = NEW.understood_at_ms IS NOT NULL,
        withdrawn = NEW.withdrawn_at_ms IS NOT NULL,
        screened_out = NEW.screened_out_at_ms IS NOT NULL,
        complete = NEW.completion_code IS NOT NULL,
        imported = NEW.import_hash IS NOT NULL
    WHERE study_id = NEW.study_id AND pilot = NEW.pilot AND number = NEW.number;
END;

CREATE TRIGGER tally_excludes AFTER INSERT ON exclusion BEGIN
    UPDATE tally SET excluded = 1 WHERE participant_id = NEW.participant_id AND NEW.ended_at_ms IS NULL;
END;

CREATE TRIGGER tally_includes AFTER UPDATE OF ended_at_ms ON exclusion BEGIN
    UPDATE tally SET excluded = EXISTS (SELECT 1 FROM exclusion
        WHERE exclusion.participant_id = NEW.participant_id AND ended_at_ms IS NULL)
    WHERE participant_id = NEW.participant_id;
END;

CREATE TRIGGER tally_forgets AFTER DELETE ON exclusion BEGIN
    UPDATE tally SET excluded = EXISTS (SELECT 1 FROM exclusion
        WHERE exclusion.participant_id = OLD.participant_id AND ended_at_ms IS NULL)
    WHERE participant_id = OLD.participant_id;
END;
