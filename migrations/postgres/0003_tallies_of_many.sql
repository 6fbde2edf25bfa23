-- Trials are stored many at a time, and with them when their participants were last seen. One statement copies what
-- changed of all of them; a trigger for each row cost more than the storing of the trial itself.
DROP TRIGGER tally_follows ON participant;

CREATE OR REPLACE FUNCTION tally_follows() RETURNS TRIGGER LANGUAGE plpgsql AS $$
BEGIN
    UPDATE tally SET last_seen_at_ms = updated.last_seen_at_ms,
        comprehension_attempts = updated.comprehension_attempts,
        understood = updated.understood_at_ms IS NOT NULL,
        withdrawn = updated.withdrawn_at_ms IS NOT NULL,
        screened_out = updated.screened_out_at_ms IS NOT NULL,
        complete = updated.completion_code IS NOT NULL,
        imported = updated.import_hash IS NOT NULL
    FROM updated
    WHERE tally.study_id = updated.study_id AND tally.pilot = updated.pilot AND tally.number = updated.number;
    RETURN NULL;
END $$;
-- A trigger that sees all changed rows at once cannot be limited to some columns.
CREATE TRIGGER tally_follows AFTER UPDATE ON participant
    REFERENCING NEW TABLE AS updated FOR EACH STATEMENT EXECUTE FUNCTION tally_follows();
