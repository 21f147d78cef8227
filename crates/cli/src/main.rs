//! The command. Everything it does is in [`kiln_cli`].

fn main() -> std::process::ExitCode {
    kiln_cli::main()
}
