//! Values printed by `--help` are valid input.

use sidestep_tests::run;

/// The names of all commands.
async fn commands() -> Vec<String> {
    let help = run(&["--help"]).await.out;
    let listed = help.split("Commands:").nth(1).expect("a list of commands");
    let names = listed.lines().skip(1).take_while(|line| !line.is_empty());
    let names = names.filter_map(|line| line.strip_prefix("  ")?.split_whitespace().next());
    names.filter(|name| *name != "help").map(str::to_owned).collect()
}

/// Every default is accepted exactly as the help prints it, so the command rejects only the flag
/// that follows.
#[tokio::test]
async fn every_default_can_be_typed_as_it_is_printed() {
    let mut tried = 0;
    let commands = commands().await;
    assert!(commands.len() > 15, "{commands:?}");
    for command in &commands {
        let help = run(&[command, "--help"]).await.out;
        let mut flag = "";
        for line in help.lines().map(str::trim) {
            if let Some(at) = line.find("--").filter(|at| *at == 0 || line.starts_with("-")) {
                flag = line[at..].split([' ', '=']).next().unwrap();
            }
            let printed = line.strip_prefix("[default: ").and_then(|rest| rest.strip_suffix(']'));
            let Some(printed) = printed else { continue };
            let typed =
                [&[command, flag][..], &printed.split(' ').collect::<Vec<_>>(), &["--absent"]];
            let said = run(&typed.concat()).await;
            assert!(said.err.contains("'--absent'"), "{command} {flag} {printed}: {}", said.err);
            tried += 1;
        }
    }
    assert!(tried > 40, "{tried} defaults: is the help read as it is printed?");
}
