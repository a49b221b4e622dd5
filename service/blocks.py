"""The controller block of a loop, and its settings to and from the one canonical controller.

A block has a form (ISA, parallel, series), a time unit (s, min) and a gain basis (engineering
units, or % of OP span per % of PV span). Inside there are only ISA, seconds and engineering units.
"""

import math
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

from loop.controller import PID, Action, ParallelPID, SeriesPID

Controller: TypeAlias = PID | ParallelPID | SeriesPID
Form: TypeAlias = Literal["isa", "parallel", "series"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """What the numbers of a controller block mean.

    Attributes
    ----------
    form : str
        isa, parallel or series.
    time_unit : str
        s or min.
    gain_basis : str
        eu (OP/PV) or percent (% of OP span per % of PV span).
    action : str
        reverse or direct.
    pv_low, pv_high : float
        PV range. [PV]
    op_low, op_high : float
        OP range. [OP]
    pv_unit, op_unit : str
        Units of the ranges.
    """

    form: Form
    time_unit: Literal["s", "min"]
    gain_basis: Literal["eu", "percent"]
    action: Literal["reverse", "direct"]
    pv_low: float
    pv_high: float
    op_low: float
    op_high: float
    pv_unit: str
    op_unit: str

    @property
    def seconds(self) -> float:
        """Seconds in the block's time unit. [s]"""
        return 60.0 if self.time_unit == "min" else 1.0

    @property
    def gain(self) -> float:
        """Gain in engineering units of a gain of 1 in the block. [OP/PV]"""
        if self.gain_basis == "eu":
            return 1.0
        return (self.op_high - self.op_low) / (self.pv_high - self.pv_low)

    def units(self) -> dict[str, str]:
        """Name the unit of every setting."""
        pv, op = self.pv_unit or "PV", self.op_unit or "OP"
        gain = f"{op}/{pv}" if self.gain_basis == "eu" else "%/%"
        time = self.time_unit
        terms = (
            {"Kp": gain, "Ki": f"{gain}/{time}", "Kd": f"{gain} {time}", "Tf": time}
            if self.form == "parallel"
            else {"Kc": gain, "Ti": time, "Td": time}
        )
        return {
            **terms,
            "pv_filter": time,
            "Tt": time,
            "op_low": op,
            "op_high": op,
            "op_rate": f"{op}/{time}",
            "sp_ramp": f"{pv}/{time}",
            "scan_time": "s",
        }

    def canonical(self, written: Controller) -> PID:
        """Turn a controller as the block has it into ISA, seconds and engineering units; exact.

        Raises
        ------
        ConversionRefused
            There is no ISA form of it.
        ValueError
            A number leaves the range of the canonical controller.
        """
        scaled = _scaled(written, gain=self.gain, time=self.seconds)
        return scaled if isinstance(scaled, PID) else scaled.to_isa()

    def written(self, pid: PID) -> Controller:
        """Turn the canonical controller into what the block has; exact.

        Raises
        ------
        ConversionRefused
            The block's form has no equivalent.
        ValueError
            A number leaves the range of the block's form.
        """
        return _scaled(self._formed(pid), gain=1 / self.gain, time=1 / self.seconds)

    def _formed(self, pid: PID) -> Controller:
        if self.form == "parallel":
            return ParallelPID.from_isa(pid)
        return SeriesPID.from_isa(pid) if self.form == "series" else pid

    @property
    def acting(self) -> Action:
        """The action as the controllers know it."""
        return Action(self.action)


def _scaled(controller: Controller, *, gain: float, time: float) -> Controller:
    """Change units: every gain by one factor, every time by another."""
    if isinstance(controller, ParallelPID):
        return replace(
            controller,
            Kp=controller.Kp * gain,
            Ki=controller.Ki * gain / time,
            Kd=controller.Kd * gain * time,
            Tf=controller.Tf * time,
            tauF=controller.tauF * time,
        )
    return replace(
        controller,
        Kc=controller.Kc * gain,
        Ti=controller.Ti * time if controller.Ti < math.inf else math.inf,
        Td=controller.Td * time,
        tauF=controller.tauF * time,
    )
