"""The only importer of rospy and messages beside nodes/: messages <-> arrays, parameters, tf, diagnostics, start-up."""

import warnings

# queue_size=None is meant: in lock-step a queue's thread costs half of the machine (docs/architecture.md).
warnings.filterwarnings(
    "ignore", message="The publisher should be created with an explicit keyword argument 'queue_size'", category=SyntaxWarning
)
