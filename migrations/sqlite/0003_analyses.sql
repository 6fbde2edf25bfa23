-- Analyses of studies: asked for, queued, run one after the other, kept with their files.

CREATE TABLE analysis (
    -- In the order of asking: they are made in it, and lists page by it.
    sequence INTEGER PRIMARY KEY,
    id TEXT NOT NULL UNIQUE,
    study_id INTEGER NOT NULL REFERENCES study (id),
    -- What was asked for, as JSON.
    request TEXT NOT NULL,
    state TEXT NOT NULL CHECK
        (state IN ('queued', 'running', 'done', 'failed', 'cancelled', 'withdrawn')),
    -- How often it was begun without coming to an end: what brings the server down is not begun
    -- for ever.
    attempts INTEGER NOT NULL DEFAULT 0 CHECK (attempts >= 0),
    -- Pieces of work.
    done INTEGER NOT NULL DEFAULT 0,
    total INTEGER NOT NULL DEFAULT 0,
    -- Those of the done ones that were not kept from before: they tell how long the rest takes.
    fresh INTEGER NOT NULL DEFAULT 0,
    created_at_ms INTEGER NOT NULL,
    started_at_ms INTEGER,
    ended_at_ms INTEGER,
    -- Why it failed.
    message TEXT,
    -- What it is about, as JSON.
    result TEXT,
    CHECK ((state IN ('queued', 'running')) = (ended_at_ms IS NULL)),
    CHECK ((state = 'done') = (result IS NOT NULL)),
    CHECK ((state = 'failed') = (message IS NOT NULL))
) STRICT;

CREATE INDEX analysis_of_study ON analysis (study_id, sequence);

-- Whose data an analysis holds: if they withdraw them, its files go too.
CREATE TABLE analysis_participant (
    analysis INTEGER NOT NULL REFERENCES analysis (sequence) ON DELETE CASCADE,
    participant_id TEXT NOT NULL REFERENCES participant (id),
    PRIMARY KEY (analysis, participant_id)
) STRICT;

-- The files that `sidestep analyze` writes, by the names that it gives them. They count once the
-- analysis is done.
CREATE TABLE analysis_file (
    analysis INTEGER NOT NULL REFERENCES analysis (sequence) ON DELETE CASCADE,
    name TEXT NOT NULL,
    -- Length before compression.
    size INTEGER NOT NULL CHECK (size >= 0),
    -- Compressed with gzip: predictions and models are long, and much the same.
    octets BLOB NOT NULL,
    PRIMARY KEY (analysis, name)
) STRICT;

-- Cells of the study's latest analysis by the hash of all that they depend on, compressed JSON:
-- the next analysis, or one that was broken off, computes only what is new.
CREATE TABLE analysis_cell (
    study_id INTEGER NOT NULL REFERENCES study (id),
    key TEXT NOT NULL,
    octets BLOB NOT NULL,
    PRIMARY KEY (study_id, key)
) STRICT;
