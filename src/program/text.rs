//! `program.txt`: the program as stable text, one line per block and per stroke, integers in nm.
