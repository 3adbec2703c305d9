"""libhaptic.so from Python: the frames as ctypes structures, and the functions that the tests call."""
import ctypes
import sys
from ctypes import POINTER, c_char_p, c_double, c_float, c_int, c_int64, c_uint32, c_uint64, c_void_p
from pathlib import Path


class Plane(ctypes.Structure):
    _fields_ = [("normal", c_double * 3), ("offset", c_double), ("velocity", c_double)]


class Proxy(ctypes.Structure):
    _fields_ = [("rest_offset", c_double * 3), ("rest_velocity", c_double * 3), ("radius", c_double),
                ("position", c_double * 3), ("surface_velocity", c_double * 3), ("in_contact", c_uint32),
                ("plane_count", c_uint32), ("planes", Plane * 3)]


class ContactFrame(ctypes.Structure):
    _fields_ = [("sequence", c_uint64), ("session", c_uint64), ("state_sequence", c_uint64), ("state_time_ns", c_int64),
                ("plane_time_ns", c_int64), ("publish_time_ns", c_int64), ("step_ns", c_int64), ("stiffness", c_double),
                ("torque_stiffness", c_double), ("static_friction", c_double), ("dynamic_friction", c_double),
                ("body_work", c_double), ("proxy_count", c_uint32), ("flags", c_uint32), ("compliance_rows", c_uint32),
                ("reserved", c_uint32), ("proxies", Proxy * 64), ("compliance", c_float * 18528)]


class DeviceState(ctypes.Structure):
    _fields_ = [("sequence", c_uint64), ("session", c_uint64), ("latch_time_ns", c_int64), ("frame_sequence", c_uint64),
                ("position", c_double * 3), ("orientation", c_double * 4), ("linear_velocity", c_double * 3),
                ("angular_velocity", c_double * 3), ("force", c_double * 3), ("torque", c_double * 3),
                ("proxy_position", c_double * 3), ("tension", c_double * 8), ("stiffness", c_double), ("scale", c_double),
                ("impulse", c_double * 3), ("angular_impulse", c_double * 3), ("safety_state", c_uint32), ("faults", c_uint32),
                ("tick_flags", c_uint32), ("buttons", c_uint32)]


def find_library(prefix: Path) -> Path:
    """libhaptic.so.0 below a prefix, in lib/ or in Debian's folder of an architecture."""
    found = list(prefix.glob("lib/libhaptic.so.0")) + list(prefix.glob("lib/*/libhaptic.so.0"))
    if len(found) != 1:
        raise SystemExit(f"libhaptic.so.0 is not once in {prefix}/lib: {found}")
    return found[0]


def load(library: Path) -> ctypes.CDLL:
    haptic = ctypes.CDLL(str(library))
    haptic.haptic_abi_version.restype = c_uint32
    haptic.haptic_last_error.restype = c_char_p
    haptic.haptic_now_ns.restype = c_int64
    for end in ("contact_writer", "state_reader", "contact_observer", "state_observer"):
        opening, closing = getattr(haptic, f"haptic_{end}_open"), getattr(haptic, f"haptic_{end}_close")
        opening.restype, opening.argtypes = c_void_p, [c_char_p]
        closing.restype, closing.argtypes = None, [c_void_p]
    for end, slot in (("contact_observer", ContactFrame), ("state_observer", DeviceState)):
        following = getattr(haptic, f"haptic_{end}_next")
        following.restype, following.argtypes = c_int, [c_void_p, POINTER(slot), c_int64]
    return haptic


def expect(what: str, found, expected) -> None:
    if found != expected:
        sys.exit(f"error: {what} is {found}, should be {expected}")
