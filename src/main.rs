//! The command. Everything it does is in [`kiln::cli`].

fn main() -> std::process::ExitCode {
    kiln::cli::main()
}
