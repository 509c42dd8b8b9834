"""What sessions must not lose: every accepted change, on disk before it is answered."""
