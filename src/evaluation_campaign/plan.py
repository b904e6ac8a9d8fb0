"""What a campaign consists of, and what of it is done: the folder is the only memory.

A run is done when its outcome.json is there, whatever it says; everything else in the folder of a run may be half written and is
made anew. So a campaign that was killed goes on with the same command.
"""

import json
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from exploration_evaluation import read_json, write_json
from explore_command.parameters import profile_names

FORMAT = 1
BY_PROFILE = "by_profile"  # every run maps as its profile and robot say
CAMPAIGN_FILE, OUTCOME_FILE = "campaign.json", "outcome.json"
MOST_SEEDS = 10_000  # a year of runs
_IDENTITY = ("format", "worlds", "seeds", "profiles", "sensor", "realism", "mapping", "movers", "movers_every", "limits", "robot", "chaos")
_EXTENSIBLE = ("worlds", "seeds", "profiles")
_SINCE_FORMAT_1 = {
    "sensor": "tilting",
    "realism": "ideal",
    "mapping": "stop_and_go",
    "movers": "",
    "movers_every": 1,
    "robot": "",
}  # what campaigns had that do not say it


class CampaignProblem(ValueError):
    """One line that says what is wrong and what to do."""


@dataclass(frozen=True)
class Limits:
    """When a run is ended: after so many simulated seconds by itself, after so many of wall time from outside."""

    sim_s: float = 1800.0
    wall_s: float = 1800.0


@dataclass(frozen=True)
class RunSpec:
    """One run: a world, a seed, a profile of parameters."""

    world: str
    seed: int
    profile: str

    @property
    def folder(self) -> Path:
        """Where the run lies below the campaign's folder."""
        return Path("runs") / Path(self.profile).stem / f"{Path(self.world).stem}-{self.seed}"


@dataclass(frozen=True)
class Campaign:
    """A campaign in its folder; `robot` is the file of its robot, empty for the project's; `mapping` one of MAPPINGS, or BY_PROFILE.

    `movers` are in the runs of every `movers_every`th seed; `chaos` is the seed of the bad hand, None for none.
    """

    out: Path
    worlds: tuple[str, ...]
    seeds: tuple[int, ...]
    profiles: tuple[str, ...]
    sensor: str
    limits: Limits
    robot: str = ""
    realism: str = "hardware"
    mapping: str = BY_PROFILE
    movers: str = ""
    movers_every: int = 1
    chaos: int | None = None

    @property
    def specs(self) -> tuple[RunSpec, ...]:
        """All runs, seed by seed, so that profiles can be compared before the last run is made."""
        return tuple(RunSpec(w, s, p) for s in self.seeds for w in self.worlds for p in self.profiles)

    def is_done(self, spec: RunSpec) -> bool:
        """Whether the run has ended, in success or not."""
        return (self.out / spec.folder / OUTCOME_FILE).is_file()

    def left(self) -> tuple[RunSpec, ...]:
        """The runs that are still to be made."""
        return tuple(spec for spec in self.specs if not self.is_done(spec))

    def movers_of(self, spec: RunSpec) -> str:
        """The movers of a run; empty for none."""
        return self.movers if spec.seed % self.movers_every == 0 else ""

    def outcome(self, spec: RunSpec) -> dict[str, object]:
        """What became of a run, with its summary under "summary" where there is one. ValueError when it is not done."""
        folder = self.out / spec.folder
        outcome = read_json(folder / OUTCOME_FILE)
        try:
            outcome["summary"] = read_json(folder / "summary.json")
        except ValueError:
            outcome["summary"] = None
        return outcome


def parse_seeds(text: str) -> tuple[int, ...]:
    """Seeds of "1-10", "3" or "1-5,8,11-12", in the order given, each once. CampaignProblem when the text is no such list."""
    seeds: dict[int, None] = {}
    for part in text.split(","):
        first, dash, last = part.strip().partition("-")
        if not first.isdecimal() or (dash and not last.isdecimal()):
            raise CampaignProblem(f"--seeds {text}: expected numbers and ranges such as 1-10 or 1-5,8")
        low, high = int(first), int(last or first)
        if low > high:
            raise CampaignProblem(f"--seeds {text}: {low}-{high} runs backwards")
        if high - low + len(seeds) >= MOST_SEEDS:
            raise CampaignProblem(f"--seeds {text}: expected {MOST_SEEDS} seeds at most")
        seeds.update(dict.fromkeys(range(low, high + 1)))
    return tuple(seeds)


def full_profiles(profiles: Sequence[object]) -> tuple[str, ...]:
    """Each once, as a campaign has them: by name, or by the full path of a file, which workers in other folders find."""
    return tuple(dict.fromkeys(p if p in profile_names() else str(Path(p).absolute()) for p in map(str, profiles)))


def open_campaign(campaign: Campaign, about: Mapping[str, object]) -> Campaign:
    """The campaign in its folder, new, gone on with, or extended by worlds, seeds or profiles; `about` (version, machine, jobs) goes into a
    new campaign.json. Each outcome.json has the version of its run.

    CampaignProblem when the folder holds something else, a campaign with runs that are not asked for, or cannot be written.
    """
    path = campaign.out / CAMPAIGN_FILE
    try:
        campaign.out.mkdir(parents=True, exist_ok=True)
        if path.exists():
            found = read_json(path)
            _check_extends(campaign, found)
            write_json(path, {**found, **_identity(campaign)})
        elif any(campaign.out.iterdir()):
            raise CampaignProblem(f"--out {campaign.out}: not empty and no campaign; choose another folder")
        else:
            started = time.strftime("%Y-%m-%dT%H:%M:%S")
            write_json(path, {**_identity(campaign), **about, "started": started})
    except OSError as error:
        raise CampaignProblem(f"--out {campaign.out}: cannot be written: {error.strerror}") from error
    except CampaignProblem:
        raise
    except ValueError as error:
        raise CampaignProblem(f"--out {campaign.out}: {error}") from error
    return campaign


def _identity(campaign: Campaign) -> dict[str, object]:
    values = asdict(campaign)
    known = {"format": FORMAT, **{key: values[key] for key in _IDENTITY[1:]}}
    plain: dict[str, object] = json.loads(json.dumps(known))
    return plain


def _check_extends(campaign: Campaign, found: Mapping[str, object]) -> None:
    asked, differing = _identity(campaign), []
    for key in _IDENTITY:
        was, now = found.get(key, _SINCE_FORMAT_1.get(key)), asked[key]
        if key == "profiles" and isinstance(was, list):
            was = list(full_profiles(was))  # earlier campaigns have them as they were given
        is_extended = key in _EXTENSIBLE and isinstance(was, list) and isinstance(now, list) and set(was) <= set(now)
        if was != now and not is_extended:
            differing.append(f"of {key} {shown(was)}, not {shown(now)}")
    if differing:
        raise CampaignProblem(f"--out {campaign.out}: holds another campaign, {'; '.join(differing)}; choose another folder")


def stored_campaign(out: Path) -> Campaign:
    """The campaign that a folder holds. CampaignProblem in one line when there is none, or its file says something else."""
    if not (out / CAMPAIGN_FILE).is_file():
        raise CampaignProblem(f"--out {out}: no campaign is there to report of: it has no {CAMPAIGN_FILE}")
    try:
        found = {**_SINCE_FORMAT_1, **read_json(out / CAMPAIGN_FILE)}
        if found.get("format") != FORMAT:
            raise ValueError(f"{CAMPAIGN_FILE} has format {found.get('format')}, not {FORMAT}")
        limits = Limits(**{name: math.nan if value is None else float(value) for name, value in found["limits"].items()})
        others = {key: found[key] for key in _IDENTITY if key in found and key not in ("format", "limits", *_EXTENSIBLE)}
        return Campaign(out, tuple(found["worlds"]), tuple(found["seeds"]), full_profiles(found["profiles"]), limits=limits, **others)
    except (ValueError, OSError) as error:
        raise CampaignProblem(f"--out {out}: {error}") from error
    except (KeyError, TypeError, AttributeError) as error:
        raise CampaignProblem(f"--out {out}: {CAMPAIGN_FILE} does not say what was asked for: {error}") from error


def shown(value: object) -> str:
    """A value as it is told: a list with commas, nothing as none."""
    if isinstance(value, Sequence) and not isinstance(value, str):
        return ",".join(str(v) for v in value)
    return "none" if value in (None, "") else str(value)
