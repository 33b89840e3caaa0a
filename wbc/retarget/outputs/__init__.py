"""What a retargeted motion is written as: arrays, tables, MuJoCo's keyframes, logs, and what learners load."""
