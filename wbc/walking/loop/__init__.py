"""The control loop of a walk: the body and its hands follow a plan, tick by tick, on one stack."""
