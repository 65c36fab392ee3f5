"""Where samples come from: scenes, recordings, serial ports and UDP, behind one interface."""
