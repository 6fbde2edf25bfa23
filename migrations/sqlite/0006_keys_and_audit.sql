-- Keys with names and rights, sessions that know their key, and the audit trail.

CREATE TABLE api_key (
    -- Never used twice: the number is visible outside.
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    -- The audit trail names keys, so a revoked key keeps its name.
    name TEXT NOT NULL UNIQUE CHECK (length(name) BETWEEN 1 AND 64),
    hash BLOB NOT NULL UNIQUE CHECK (length(hash) = 32),
    access TEXT NOT NULL CHECK (access IN ('read', 'export', 'manage')),
    -- The key that the server makes at its first start; a key in the environment takes its place.
    is_first INTEGER NOT NULL DEFAULT 0 CHECK (is_first IN (0, 1)),
    created_at_ms INTEGER NOT NULL,
    -- To the minute.
    last_used_at_ms INTEGER,
    revoked_at_ms INTEGER
) STRICT;

INSERT INTO api_key (name, hash, access, is_first, created_at_ms)
SELECT 'first key', hash, 'manage', 1, created_at_ms FROM admin_key LIMIT 1;

DROP TABLE admin_key;

-- The key that signed in; NULL for the key in the environment.
ALTER TABLE session ADD COLUMN key_id INTEGER REFERENCES api_key (id) ON DELETE CASCADE;

UPDATE session SET key_id = (SELECT id FROM api_key);

CREATE INDEX session_by_key ON session (key_id);

-- Who exported, changed or deleted what. The entry of a change is written in the transaction that makes
-- the change.
CREATE TABLE audit (
    sequence INTEGER PRIMARY KEY AUTOINCREMENT,
    at_ms INTEGER NOT NULL,
    who TEXT NOT NULL,
    action TEXT NOT NULL,
    study TEXT,
    subject TEXT
) STRICT;

-- A key that is refused again and again has one entry a minute for each route.
CREATE INDEX refused ON audit (who, subject, at_ms) WHERE action = 'refused';
