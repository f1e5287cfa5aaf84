"""Tasks that are simulated: an arm performs a movement in MuJoCo, and something comes of it."""
