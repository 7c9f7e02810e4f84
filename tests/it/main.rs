//! The integration tests: the program is run on made and real input. README.md of the folder above says
//! which rule is tested where.

mod support;

mod bad_input;
mod bad_surfaces;
mod bad_svg;
mod batch;
mod bound;
mod cad;
mod cli;
mod closed_forms;
mod compare;
mod determinism;
mod docs;
mod dose;
mod fill;
mod foreign;
mod frames;
mod golden;
mod layers;
mod lengths;
mod merge;
mod method;
mod modes;
mod on_the_fly;
mod on_the_fly_random;
mod operator;
mod order;
mod orient;
mod partition;
mod passes;
mod random_jobs;
mod reads;
mod refusals;
mod resume;
mod run;
mod run_grbl;
mod run_linuxcnc;
mod setups;
mod sweep;
mod textures;
mod tilt;
mod turned;
mod wide;
mod zoom;
