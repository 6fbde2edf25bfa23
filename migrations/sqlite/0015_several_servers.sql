-- What several servers on one database need, and truth values in the words that every database has.
-- (SQLite has one server; its tables are those of PostgreSQL, so that studies can be copied both ways.)

-- Which server computes an analysis, and until when nobody else takes it over. The server renews the lease
-- while it computes; after the lease has run out, another server begins the analysis again, and what the
-- first one still finds is not accepted.
ALTER TABLE analysis ADD COLUMN worker TEXT;
ALTER TABLE analysis ADD COLUMN lease_until_ms INTEGER;

-- A condition on an index must be repeated by queries word for word.
DROP INDEX place_of_study;
CREATE UNIQUE INDEX place_of_study ON participant (study_id, place) WHERE holds_place;

-- A participant's tokens are found without reading all tokens.
CREATE INDEX token_of_participant ON participant_token (participant_id);
