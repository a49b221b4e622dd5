"""The loop as its scans see it: sampled process and digital law on the unit circle."""

from dataclasses import dataclass

import numpy as np

from loop.controller import PID
from loop.digital_pid import AntiWindup, ScanLaw, scan_laws
from loop.process import Process
from loop.sampled_process import sampled
from loop.signals import Complex


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SampledResponse:
    """Process and law at points z, exact for the simulated loop.

    Attributes
    ----------
    process : ndarray of complex, shape (n,)
        From the output to PV. [PV/OP]
    law : ndarray of complex, shape (n,)
        From PV to the output with its sign turned, filter of PV included. [OP/PV]
    """

    process: Complex
    law: Complex

    @property
    def noise_to_output(self) -> Complex:
        """From the sensor's noise to the output, -C/(1 + P C). [OP/PV]"""
        return np.asarray(-self.law / (1 + self.process * self.law))


def sampled_response(
    process: Process, pid: PID, z: Complex, *, scan_time: float, pv_filter: float = 0.0
) -> SampledResponse:
    """Evaluate process and law of a scanned loop.

    P(z) = C (z I - Phi)^-1 (late z^(-q-1) + early z^-q) + D z^(-q-1)
    C(z) = M F (kP + kI/2 (z + 1)/(z - 1) + kD (z - 1)/(z - dD)), F = (f0 z + f1)/(z - dF), and M
    the same with the filter's time constant

    Parameters
    ----------
    process : Process
        Process model.
    pid : PID
        Controller settings.
    z : ndarray of complex, shape (n,)
        Points, not 1 and no pole.
    scan_time : float
        Scan time. [s]
    pv_filter : float
        Time constant of a first-order filter on PV, 0 for none. [s]
    """
    law = scan_laws([pid], scan_time, anti_windup=AntiWindup.NONE, Tt=None)
    C = law_response(law, z)[0]
    if pv_filter:
        d = np.exp(-scan_time / pv_filter)
        part = (1 - d) * pv_filter / scan_time
        C *= ((1 - part) * z + part - d) / (z - d)
    return SampledResponse(process=held_response(process, z, dt=scan_time), law=C)


def held_response(process: Process, z: Complex, *, dt: float) -> Complex:
    """Evaluate a process whose input holds between the scans, PV over OP. [PV/OP]

    Parameters
    ----------
    process : Process
        Process model.
    z : ndarray of complex, shape (n,)
        Points, no pole.
    dt : float
        Scan time. [s]
    """
    plant = sampled([process], dt)
    order, q = plant.C.shape[1], int(plant.q[0])
    inputs = plant.late[0] / z[:, None] + plant.early[0]
    states = np.linalg.solve(z[:, None, None] * np.eye(order) - plant.Phi[0], inputs[:, :, None])[
        :, :, 0
    ]
    return np.asarray((states @ plant.C[0] + plant.D[0] / z) * z**-q)


def law_response(law: ScanLaw, z: Complex) -> Complex:
    """Evaluate the laws of m controllers from PV to the output, sign turned. [OP/PV]

    Parameters
    ----------
    law : ScanLaw
        Numbers of m controllers.
    z : ndarray of complex, shape (n,)
        Points, not 1 and no pole.

    Returns
    -------
    ndarray of complex, shape (m, n)
    """
    kP, kI, kD, dD, dF, f0, f1 = (
        column[:, None] for column in (law.kP, law.kI, law.kD, law.dD, law.dF, law.f0, law.f1)
    )
    C: Complex = kP + kI / 2 * (z + 1) / (z - 1) + kD * (z - 1) / (z - dD)
    return np.asarray(C * (f0 * z + f1) / (z - dF))
