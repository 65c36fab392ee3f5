"""ON/OFF slip from the raw voltages of tactile fingertips, after Romeo et al. (2017)."""
