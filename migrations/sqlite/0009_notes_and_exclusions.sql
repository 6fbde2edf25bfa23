-- What experimenters write about participants, and whose data analyses leave out.

CREATE TABLE note (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    participant_id TEXT NOT NULL REFERENCES participant (id) ON DELETE CASCADE,
    text TEXT NOT NULL,
    at_ms INTEGER NOT NULL,
    -- The name of the key.
    who TEXT NOT NULL
) STRICT;
CREATE INDEX note_of_participant ON note (participant_id, id);

-- A row each time that a participant is excluded; it ends when they are included again. The data stay.
CREATE TABLE exclusion (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    participant_id TEXT NOT NULL REFERENCES participant (id) ON DELETE CASCADE,
    reason TEXT NOT NULL,
    at_ms INTEGER NOT NULL,
    who TEXT NOT NULL,
    ended_at_ms INTEGER
) STRICT;
CREATE UNIQUE INDEX excluded ON exclusion (participant_id) WHERE ended_at_ms IS NULL;
