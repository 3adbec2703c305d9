"""Deformable objects in contact with a haptic tool: simulate scenes, exchange planes with rt-core, query contacts.

    import haptic

    sim = haptic.Simulation("cloth-drop", {"model.material": "silk"})
    run = sim.run(duration=1.0)
    print(run.time[-1], run.hand_force[-1], sim.vertices.mean(axis=0))

haptic.study makes tables of many runs, on all processors and on other machines.

SI units; coordinate frames are right-handed, y up; rotations are (w, x, y, z). help(haptic.Simulation) goes on.
"""
from typing import Any as _Any

import numpy as _numpy
from numpy.typing import NDArray as _NDArray

from ._core import (CONTACT_FRAME, DEVICE_STATE, BarMeasured, Body, Drape, Observer, Particles, PressMeasured,
                    RecordingError, SceneError, Session, SessionError, SheetMaterial, SheetMeasured, Simulation,
                    SolidMaterial, __version__, ccd, describe_state, load_recording, materials, measure_bending,
                    measure_drape, measure_membrane, measure_press, measure_sheet_bending, measure_tension,
                    measure_torsion, now_ns, scenes)

FEATURES = ("none", "face", "edge", "vertex")
"""Names of the field `touched` of ccd()."""


def contact_frame(*, stiffness: float, step_ns: int, proxies: int = 1) -> _NDArray[_numpy.void]:
    """A contact frame without planes, for Session.publish: a zero-dimensional array of haptic.CONTACT_FRAME.

    stiffness  N/m, of the coupling as felt at the hand
    step_ns    time until the next frame follows
    proxies    number of spheres of the tool

    A floor at y = 0:

        frame = haptic.contact_frame(stiffness=500.0, step_ns=1_000_000)
        frame["proxies"]["plane_count"][0] = 1
        frame["proxies"]["planes"]["normal"][0, 0] = 0.0, 1.0, 0.0
        frame["plane_time_ns"] = haptic.now_ns()
    """
    frame = _numpy.zeros((), CONTACT_FRAME)
    if not 1 <= proxies <= frame["proxies"].shape[0]:
        raise ValueError(f"proxies must be 1 to {frame['proxies'].shape[0]}, found {proxies}")
    frame["stiffness"] = stiffness
    frame["step_ns"] = step_ns
    frame["proxy_count"] = proxies
    return frame


def poses(recording: _Any) -> _NDArray[_numpy.float64]:
    """Poses of the grip of a recording, (N, 7), m and (w, x, y, z), device frame: for Simulation.follow.

    recording  from load_recording(), of host-sim or rt-core
    """
    names = recording.dtype.names
    columns = [recording[name] for name in ("x_m", "y_m", "z_m")]
    if "qw" in names:
        columns += [recording[name] for name in ("qw", "qx", "qy", "qz")]
    else:
        columns += [_numpy.ones(len(recording))] + 3 * [_numpy.zeros(len(recording))]
    return _numpy.stack(columns, axis=-1)


__all__ = [
    "CONTACT_FRAME", "DEVICE_STATE", "FEATURES", "BarMeasured", "Body", "Drape", "Observer", "Particles",
    "PressMeasured", "RecordingError", "SceneError", "Session", "SessionError", "SheetMaterial", "SheetMeasured",
    "Simulation", "SolidMaterial", "__version__", "ccd", "contact_frame", "describe_state", "load_recording",
    "materials", "measure_bending", "measure_drape", "measure_membrane", "measure_press", "measure_sheet_bending",
    "measure_tension", "measure_torsion", "now_ns", "poses", "scenes",
]
