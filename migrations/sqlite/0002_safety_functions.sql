-- Which value functions the safety levels of a configuration are read from, one for each vehicle
-- that evades. They are solved after the configuration is stored, so a row may be missing for a
-- while; once there, it is never changed: what was analysed with it stays as it was.
CREATE TABLE safety_function (
    -- Configurations, not studies: participants keep the one that they were enrolled under.
    config_hash TEXT NOT NULL REFERENCES study_config (hash),
    -- V_HR: the human evades. V_RH: the robot.
    evader TEXT NOT NULL CHECK (evader IN ('human', 'robot')),
    -- Equal vehicles have one function for both.
    value_function_id TEXT NOT NULL REFERENCES value_function (id),
    PRIMARY KEY (config_hash, evader)
) STRICT;
