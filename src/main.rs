//! The command `terrace`: parse, run, exit code.

use std::process::ExitCode;

fn main() -> ExitCode {
    terrace::cli::main()
}
