-- How often the holder of a token that only continues answered the check of understanding: such attempts
-- cost the participant none.
ALTER TABLE participant_token ADD COLUMN check_attempts INTEGER NOT NULL DEFAULT 0
    CHECK (check_attempts >= 0);
