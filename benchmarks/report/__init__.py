"""The report of speed against error: the project's renderers and its peers, over the same views.

`views` says what is looked at, `truth` how far a frame is off, `trials` what is kept of a measurement;
`ours`, `peers`, `profile` and `scaling` measure; `front`, `plots` and `document` tell.
"""
