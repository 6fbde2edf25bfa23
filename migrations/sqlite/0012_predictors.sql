-- What is known of the models of an analysis, and which trials trained and tested them, so that a list
-- of models and a replay need not read the models themselves.

CREATE TABLE analysis_predictor (
    id INTEGER PRIMARY KEY,
    analysis INTEGER NOT NULL,
    -- Its file, which begins with this part: a model is listed as long as its file is there.
    name TEXT NOT NULL,
    part INTEGER NOT NULL DEFAULT 0 CHECK (part = 0),
    -- Whom it predicts: the participant's number in the study of the analysis.
    participant_number INTEGER NOT NULL CHECK (participant_number >= 1),
    -- Its place in the tables of the analysis, which lists keep.
    place INTEGER NOT NULL CHECK (place >= 0),
    model TEXT NOT NULL,
    experiment INTEGER NOT NULL CHECK (experiment IN (1, 2)),
    -- The name of its feature set, and the names in it as JSON.
    feature_set TEXT NOT NULL,
    features TEXT NOT NULL,
    -- Shares of steps, from 0 to 1.
    cv_accuracy REAL NOT NULL,
    test_accuracy REAL NOT NULL,
    UNIQUE (analysis, name),
    FOREIGN KEY (analysis, name, part) REFERENCES analysis_file (analysis, name, part)
        ON DELETE CASCADE
) STRICT;

-- Everything that a list filters and sorts by.
CREATE INDEX predictor_of_participant ON analysis_predictor
    (analysis, participant_number, place, model, experiment, feature_set);

-- The tasks that an analysis used. They are gone with the participant: analysis_participant is.
CREATE TABLE analysis_trial (
    analysis INTEGER NOT NULL,
    participant_id TEXT NOT NULL,
    trial_id TEXT NOT NULL,
    -- 1 if it trained the participant's models, 0 if it tested them.
    trains INTEGER NOT NULL CHECK (trains IN (0, 1)),
    PRIMARY KEY (analysis, participant_id, trial_id),
    FOREIGN KEY (analysis, participant_id)
        REFERENCES analysis_participant (analysis, participant_id) ON DELETE CASCADE
) STRICT, WITHOUT ROWID;
