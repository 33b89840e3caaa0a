"""Classical rate resolution of a redundant arm beside pairs of task and constraint coordinates."""
