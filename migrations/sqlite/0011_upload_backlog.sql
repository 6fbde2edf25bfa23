-- How many trials waited in the participant's browser when the server last stored one of theirs. Earlier
-- pages did not say it.
ALTER TABLE tally ADD COLUMN waiting INTEGER NOT NULL DEFAULT 0;
