"""One session's state machine: edits in, time-sliced work, frames out."""
