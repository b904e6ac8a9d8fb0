"""Which registration stands behind `match_clouds`: the one place that knows all of them."""

from pose_graph_mapping.config import RegistrationConfig
from pose_graph_mapping.registration.gicp import GicpRegistration
from pose_graph_mapping.registration.matching import Registration
from pose_graph_mapping.registration.thesis_chain import ThesisChainRegistration


def create_registration(config: RegistrationConfig) -> Registration:
    """The implementation that `config.method` names; ValueError lists every wrong value."""
    problems = config.validate()
    if problems:
        raise ValueError("; ".join(problems))
    return ThesisChainRegistration(config) if config.method == "thesis_chain" else GicpRegistration(config)
