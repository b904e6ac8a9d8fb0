"""Does the base do what it is told? An e-stop, a lock or a twist_mux may keep its wheels while everything else goes on."""

import math

from path_following.manoeuvres import Motion

_TOLD_MPS, _TOLD_RADPS = 0.1, 0.2  # so fast a command turns the wheels of every base
_STANDS_MPS, _STANDS_RADPS = 0.01, 0.02  # odometry below both: they stand
_NOTICED_AFTER_S = 1.5
_RECOVERY_AFTER_S = 6.0  # something may block the wheels; the patience of progress, too
_CREEP_MPS, _CREEP_RADPS = 0.1, 0.3  # what wheels that are let go begin with
_UNTOLD_S = 0.5  # nothing is told for so long: then nobody knows
_MAX_GAP_S = 0.5


class Obedience:
    """Compares what was sent with what odometry measured, a step at a time. Pauses and leaps of the clock begin anew."""

    def __init__(self) -> None:
        self.reset()

    def reset(self, stamp_s: float | None = None) -> None:
        """Nothing is known before `stamp_s`; None: nor of now."""
        self.obeys = True
        self._last_s = stamp_s
        self._stands_since_s: float | None = None  # told to drive since then
        self._untold_s = 0.0
        self._has_recovered = False

    def take_in(self, stamp_s: float, sent: Motion, twist: tuple[float, float] | None) -> float:
        """What was `sent` before `stamp_s` s, and the `twist` (m/s, rad/s) that is measured there; None: not known.

        Seconds, up to here, that are no lack of progress.
        """
        last_s, self._last_s = self._last_s, stamp_s
        is_gap = last_s is None or not 0.0 <= stamp_s - last_s <= _MAX_GAP_S
        if is_gap or twist is None or not _stands(*twist):
            self.reset(stamp_s)
            return 0.0
        assert last_s is not None
        return self._stood(last_s, stamp_s, sent)

    def _stood(self, last_s: float, stamp_s: float, sent: Motion) -> float:
        least = (_TOLD_MPS, _TOLD_RADPS) if self.obeys else (1e-9, 1e-9)
        is_told = abs(sent.v) >= least[0] or abs(sent.w) >= least[1]
        self._untold_s = 0.0 if is_told else self._untold_s + stamp_s - last_s
        if not is_told and (self.obeys or self._untold_s > _UNTOLD_S):
            self.reset(stamp_s)
            return 0.0
        self._stands_since_s = last_s if self._stands_since_s is None else self._stands_since_s
        if not self.obeys:
            return stamp_s - last_s
        self.obeys = stamp_s - self._stands_since_s < _NOTICED_AFTER_S
        return 0.0 if self.obeys else stamp_s - self._stands_since_s

    @property
    def words(self) -> str:
        """What is wrong; empty while it obeys."""
        return "" if self.obeys else "the base does not obey: told to drive, it stands (e-stop, lock, twist_mux?)"

    def takes_recovery(self, stamp_s: float) -> bool:
        """Whether it is time to back off, once: something may block the wheels."""
        since_s = self._stands_since_s
        if self.obeys or self._has_recovered or since_s is None or stamp_s - since_s < _RECOVERY_AFTER_S:
            return False
        self._has_recovered = True
        return True

    def crept(self, motion: Motion) -> Motion:
        """The same way, no faster than wheels may jerk that are let go."""
        share = min(1.0, _CREEP_MPS / max(abs(motion.v), 1e-9), _CREEP_RADPS / max(abs(motion.w), 1e-9))
        return Motion(share * motion.v, share * motion.w)


def _stands(v: float, w: float) -> bool:
    return math.isfinite(v) and math.isfinite(w) and abs(v) < _STANDS_MPS and abs(w) < _STANDS_RADPS
