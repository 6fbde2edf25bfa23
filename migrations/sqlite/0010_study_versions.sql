-- The configurations that new participants of a study have got, in their order.

CREATE TABLE study_version (
    study_id INTEGER NOT NULL REFERENCES study (id),
    -- From 1 within the study.
    number INTEGER NOT NULL CHECK (number >= 1),
    config_hash TEXT NOT NULL REFERENCES study_config (hash),
    since_ms INTEGER NOT NULL,
    -- Whether the study file of a command said so, and not the laboratory: a restart with the same file
    -- must not undo what was changed in the laboratory since. Unknown of earlier databases.
    by_file INTEGER NOT NULL DEFAULT 0 CHECK (by_file IN (0, 1)),
    PRIMARY KEY (study_id, number)
) STRICT, WITHOUT ROWID;

-- Earlier databases know the configurations under which somebody enrolled, and the present one.
INSERT INTO study_version (study_id, number, config_hash, since_ms)
SELECT study_id, row_number() OVER (PARTITION BY study_id ORDER BY since_ms, config_hash), config_hash, since_ms
FROM (SELECT study_id, config_hash, min(enrolled_at_ms) AS since_ms
      FROM participant GROUP BY study_id, config_hash);

INSERT INTO study_version (study_id, number, config_hash, since_ms)
SELECT study.id,
       1 + (SELECT count(*) FROM study_version WHERE study_id = study.id),
       config_hash,
       coalesce((SELECT max(enrolled_at_ms) FROM participant WHERE study_id = study.id), created_at_ms)
FROM study
WHERE config_hash IS NOT (SELECT v.config_hash FROM study_version v WHERE v.study_id = study.id
                          ORDER BY v.number DESC LIMIT 1);
