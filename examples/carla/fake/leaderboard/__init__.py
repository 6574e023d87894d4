"""A small stand-in for the package of the CARLA Leaderboard, for tests."""
