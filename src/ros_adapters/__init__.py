"""The only importer of rospy and messages beside nodes/: messages <-> arrays, parameters, tf, diagnostics, start-up."""
