-- By its mark, a file and its write-ahead log are known to belong together: an identity that was drawn when the
-- database was made, the number of its commits, and what the last two commits have drawn at random. Each commit of the
-- program writes it anew, so that it is in every log, and copies of a database that went on each by itself are told apart.
-- All marks are equally long: they are found in pages whose structure nobody reads.
CREATE TABLE mark (text TEXT NOT NULL CHECK (length(text) = 101)) STRICT;
INSERT INTO mark VALUES
    (printf('sidestep mark %s %020d %016d %s', lower(hex(randomblob(16))), 0, 0, lower(hex(randomblob(8)))));
