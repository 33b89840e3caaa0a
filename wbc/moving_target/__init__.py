"""Work on an object that moves: how it moves, one trial, many trials and their pictures."""
