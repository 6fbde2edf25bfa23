-- How many models an analysis has of each kind and for each participant, so that a list of all of them
-- need not count them.

CREATE TABLE predictor_kind (
    analysis INTEGER NOT NULL,
    model TEXT NOT NULL,
    experiment INTEGER NOT NULL,
    feature_set TEXT NOT NULL,
    models INTEGER NOT NULL CHECK (models >= 0),
    PRIMARY KEY (analysis, model, experiment, feature_set)
) STRICT, WITHOUT ROWID;

CREATE TABLE predictor_participant (
    analysis INTEGER NOT NULL,
    participant_number INTEGER NOT NULL,
    models INTEGER NOT NULL CHECK (models >= 0),
    PRIMARY KEY (analysis, participant_number)
) STRICT, WITHOUT ROWID;

INSERT INTO predictor_kind (analysis, model, experiment, feature_set, models)
SELECT analysis, model, experiment, feature_set, count(*) FROM analysis_predictor
GROUP BY analysis, model, experiment, feature_set;

INSERT INTO predictor_participant (analysis, participant_number, models)
SELECT analysis, participant_number, count(*) FROM analysis_predictor
GROUP BY analysis, participant_number;

CREATE TRIGGER predictor_counted AFTER INSERT ON analysis_predictor BEGIN
    INSERT INTO predictor_kind (analysis, model, experiment, feature_set, models)
    VALUES (NEW.analysis, NEW.model, NEW.experiment, NEW.feature_set, 1)
    ON CONFLICT DO UPDATE SET models = models + 1;
    INSERT INTO predictor_participant (analysis, participant_number, models)
    VALUES (NEW.analysis, NEW.participant_number, 1)
    ON CONFLICT DO UPDATE SET models = models + 1;
END;

CREATE TRIGGER predictor_discounted AFTER DELETE ON analysis_predictor BEGIN
    UPDATE predictor_kind SET models = models - 1
    WHERE analysis = OLD.analysis AND model = OLD.model AND experiment = OLD.experiment
        AND feature_set = OLD.feature_set;
    DELETE FROM predictor_kind
    WHERE analysis = OLD.analysis AND model = OLD.model AND experiment = OLD.experiment
        AND feature_set = OLD.feature_set AND models = 0;
    UPDATE predictor_participant SET models = models - 1
    WHERE analysis = OLD.analysis AND participant_number = OLD.participant_number;
    DELETE FROM predictor_participant
    WHERE analysis = OLD.analysis AND participant_number = OLD.participant_number AND models = 0;
END;
