-- By its mark, a file and its write-ahead log are known to belong together: an identity that was drawn when the
-- database was made, and the number of its commits, which each commit of the program writes anew, so that it is in every log.
-- All marks are equally long: they are found in pages whose structure nobody reads.
CREATE TABLE mark (text TEXT NOT NULL CHECK (length(text) = 67)) STRICT;
INSERT INTO mark VALUES (printf('sidestep mark %s %020d', lower(hex(randomblob(16))), 0));
