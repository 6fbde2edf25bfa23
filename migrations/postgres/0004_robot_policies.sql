-- A scene says by which rule its robot moves, as JSON, like the poses at its start: a plan survives every later change of
-- the study. NULL: the robot drives straight, as in every scene before this file.
DROP VIEW stored_trial;
ALTER TABLE scene ADD COLUMN policy TEXT;
CREATE VIEW stored_trial AS
SELECT trial.sequence, trial.trial_id, trial.content_version, trial.content_hash,
       trial.received_at_ms, trial.started_at_ms,
       trial.inputs, trial.states, trial.sampled_at_ms, trial.key_events, trial.page_events,
       trial.exposures, trial.display, trial.flags,
       trial.closest_m, trial.first_step_in_danger, trial.avoidance_first, trial.avoidance_last,
       scene.ordinal, scene.phase, scene.idx, scene.attempt,
       scene.human_x, scene.human_y, scene.human_psi,
       scene.robot_x, scene.robot_y, scene.robot_psi, scene.goal_x, scene.goal_y, scene.policy,
       participant.id AS participant_id, participant.number AS participant_number,
       participant.pilot,
       trial.study_id, participant.config_hash,
       study.slug AS study
FROM trial
JOIN scene ON scene.trial_id = trial.trial_id
JOIN participant ON participant.id = scene.participant_id
JOIN study ON study.id = trial.study_id;
