"""Global illumination of edited scenes: geometry, visibility, light transport, frames."""
