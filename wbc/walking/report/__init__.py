"""What a run leaves behind: its folder, figures, plots and pictures."""
