-- What the list of participants shows about trials, so that it reads no trial.

-- A number that follows from the times of the key events: two trials in which somebody presses keys have
-- the same only if a program repeats itself. NULL with fewer than four events, and in earlier rows.
ALTER TABLE trial ADD COLUMN key_timing INTEGER;
CREATE INDEX trial_of_timing ON trial (study_id, key_timing) WHERE key_timing IS NOT NULL;

-- Covers the stages of a study's participants.
CREATE INDEX people ON participant (study_id, pilot, number, id, withdrawn_at_ms, screened_out_at_ms,
                                    completion_code, import_hash);

-- One row a participant with a stored trial, written in the transaction that stores the trial.
CREATE TABLE tally (
    participant_id TEXT PRIMARY KEY REFERENCES participant (id) ON DELETE CASCADE,
    -- The phase of the scene that comes next; NULL after the last.
    next_phase TEXT,
    -- Stored trials by phase, further attempts too.
    familiarisation INTEGER NOT NULL,
    practice INTEGER NOT NULL,
    task INTEGER NOT NULL,
    -- Tasks with such a flag, first and further attempts.
    late_sample INTEGER NOT NULL,
    focus_lost INTEGER NOT NULL,
    interrupted INTEGER NOT NULL,
    -- Tasks without a turn; with a turn in each step; in which the human entered the danger zone; with the
    -- key times of an earlier trial of the study.
    never_steered INTEGER NOT NULL,
    always_steered INTEGER NOT NULL,
    danger_entered INTEGER NOT NULL,
    same_timing INTEGER NOT NULL
) STRICT, WITHOUT ROWID;

INSERT INTO tally
SELECT scene.participant_id, NULL,
       sum(scene.phase = 'familiarisation'), sum(scene.phase = 'practice'), sum(scene.phase = 'task'),
       sum(scene.phase = 'task' AND instr(';' || flags || ';', ';late_sample;') > 0),
       sum(scene.phase = 'task' AND instr(';' || flags || ';', ';focus_lost;') > 0),
       sum(scene.phase = 'task' AND instr(';' || flags || ';', ';interrupted;') > 0),
       sum(scene.phase = 'task' AND avoidance_first IS NULL),
       sum(scene.phase = 'task' AND instr(inputs, x'00') = 0),
       sum(scene.phase = 'task' AND first_step_in_danger IS NOT NULL),
       0
FROM trial JOIN scene ON scene.trial_id = trial.trial_id
GROUP BY scene.participant_id;

-- Trials are stored in the plan's order.
UPDATE tally SET next_phase = (SELECT phase FROM scene
                               WHERE scene.participant_id = tally.participant_id
                                 AND ordinal = familiarisation + practice + task);
