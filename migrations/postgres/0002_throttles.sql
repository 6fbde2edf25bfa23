-- What several servers count together: wrong keys and enrolments of an address. A crash of the database may
-- forget it, so it needs no log.
CREATE UNLOGGED TABLE throttle (
    kind TEXT NOT NULL,
    -- A hash, for addresses of people are nobody's business.
    who BYTEA NOT NULL,
    -- When they have all their turns again, ms; afterwards the row says nothing.
    full_at_ms BIGINT NOT NULL,
    PRIMARY KEY (kind, who)
);
CREATE INDEX throttle_full_at ON throttle (full_at_ms);
