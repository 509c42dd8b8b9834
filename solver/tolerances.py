"""The one tolerance policy: every geometric epsilon is relative to the size of what is compared.

[H appendix A] has three absolute epsilons (`_m_eps_f`, `ffPushOff`, `nudgeAmt`); here each is a
dimensionless factor times a length of the scene, so that a scene of 1e-3 m and one of 1e4 m are
treated alike.
"""

from __future__ import annotations

from typing import Final

PLANARITY: Final = 1e-5
"""A face is planar if its vertices leave its plane by at most this times the face's diameter."""

DEGENERATE_AREA: Final = 1e-10
"""A face is dropped if its area is at most this times the square of its own diameter."""

DEGENERATE_LENGTH: Final = 1e-12
"""A face is dropped if its diameter is at most this times the scene's size."""

SIDE: Final = 1e-9
"""A point lies on a plane if its distance is at most this times the scene's size."""

RAY_OFFSET: Final = 2e-6
"""Ray endpoints leave their surface by this times the scene's size: about 16 float32 spacings of the
unit box in which Embree sees the scene."""

LEAST_RAY_OFFSET: Final = 3e-7
"""As `RAY_OFFSET`, of rays whose ends are known in float64: of 16 million, at all angles, in places all over
the unit box, four met their own surfaces from 2e-7, and none from 2.5e-7."""

TOUCH: Final = 1e-6
"""In float32, points nearer to a polygon's plane than this times the scene's size are not behind it."""
