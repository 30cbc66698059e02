"""Drawing: canvas, marks, runs, close-ups, video, window."""
