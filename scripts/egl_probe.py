"""Tell whether this machine can make an OpenGL context without a screen.

It walks the way that the renderer's context takes: libEGL and libGL are loaded, EGL is asked for its
devices, and a device's display is initialised, which loads the driver. Exit status 0 when one works;
otherwise 1, with the reason on standard output. Standard library only, since it runs before anything
is installed.
"""

from __future__ import annotations

import ctypes
import sys
from typing import Final

EGL_PLATFORM_DEVICE_EXT: Final = 0x313F
EGL_EXTENSIONS: Final = 0x3055
MAX_DEVICES: Final = 16


def failure() -> str | None:
    """Why no display can be initialised, or None when one can."""
    # Load the libraries: the vendor-neutral fronts, which find the driver when they are used.
    try:
        ctypes.CDLL("libGL.so.1")
        egl = ctypes.CDLL("libEGL.so.1")
    except OSError as error:
        return str(error)

    egl.eglQueryString.restype = ctypes.c_char_p
    egl.eglQueryString.argtypes = [ctypes.c_void_p, ctypes.c_int]
    egl.eglGetProcAddress.restype = ctypes.c_void_p
    egl.eglGetProcAddress.argtypes = [ctypes.c_char_p]
    egl.eglInitialize.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p]

    # Ask for the devices; without a driver (an EGL vendor) there is not even the extension.
    extensions = (egl.eglQueryString(None, EGL_EXTENSIONS) or b"").split()
    if b"EGL_EXT_platform_device" not in extensions or b"EGL_EXT_platform_base" not in extensions:
        return "libEGL finds no driver"
    query_devices = ctypes.CFUNCTYPE(ctypes.c_uint, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)(
        egl.eglGetProcAddress(b"eglQueryDevicesEXT")
    )
    get_display = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_uint, ctypes.c_void_p, ctypes.c_void_p)(
        egl.eglGetProcAddress(b"eglGetPlatformDisplayEXT")
    )
    devices = (ctypes.c_void_p * MAX_DEVICES)()
    count = ctypes.c_int(0)
    if not query_devices(MAX_DEVICES, devices, ctypes.byref(count)) or count.value == 0:
        return "libEGL lists no device"

    # Initialise a display: this is where a driver without its libraries gives up.
    for device in devices[: count.value]:
        display = get_display(EGL_PLATFORM_DEVICE_EXT, device, None)
        if display and egl.eglInitialize(display, None, None):
            return None
    return f"none of the {count.value} EGL devices can be initialised"


def main() -> int:
    """Print the reason, if any, and return the exit status."""
    reason = failure()
    if reason is not None:
        print(reason)
    return 0 if reason is None else 1


if __name__ == "__main__":
    sys.exit(main())
