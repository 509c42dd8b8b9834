"""Streams: frames to a client as they improve, cameras and edits from it, over one WebSocket."""
