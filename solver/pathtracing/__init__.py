"""The path-traced check: unbiased radiance and irradiance, sharing only geometry and rays with transport."""

from solver.pathtracing.estimate import ProgressiveEstimate
from solver.pathtracing.frame import PathTracedFrame
from solver.pathtracing.tracer import PathTracer

__all__ = ["PathTracedFrame", "PathTracer", "ProgressiveEstimate"]
