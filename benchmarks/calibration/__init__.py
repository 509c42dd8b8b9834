"""How far error estimates can be trusted: what is told against what is true, on many scenes and stages."""
