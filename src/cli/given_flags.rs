//! Which flags stand on a command line, as opposed to those that are at their defaults, and the words that give them
//! again to another command line.

use std::ffi::OsString;

use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches};

/// The flags that were given. Flattened into a struct of arguments it adds no argument and takes down all of them; it
/// must be the struct's first field, since every field takes its values out of the matches.
#[derive(Clone, Debug, Default)]
pub(crate) struct GivenFlags(Vec<(String, Vec<OsString>)>);

impl GivenFlags {
    /// Whether the argument of this id was given.
    pub(crate) fn has(&self, id: &str) -> bool {
        self.0.iter().any(|(given, _)| given == id)
    }

    /// The first of these ids that was given, as `--name`.
    pub(crate) fn first_of(&self, ids: &[&str]) -> Option<String> {
        ids.iter().find(|id| self.has(id)).map(|id| format!("--{}", id.replace('_', "-")))
    }

    /// The flags as words, `--name=value`, without those that `over` gives too or that exclude one of its flags.
    pub(crate) fn words_under(&self, over: &Self, command: &Command) -> Vec<OsString> {
        let conflicts =
            |a: &Arg, b: &Arg| command.get_arg_conflicts_with(a).iter().any(|arg| arg.get_id() == b.get_id());
        let stronger: Vec<_> = command.get_arguments().filter(|arg| over.has(arg.get_id().as_str())).collect();
        let yields = |arg: &Arg| {
            stronger.iter().any(|over| arg.get_id() == over.get_id() || conflicts(arg, over) || conflicts(over, arg))
        };
        command.get_arguments().filter(|arg| !yields(arg)).flat_map(|arg| self.words(arg)).collect()
    }

    fn words(&self, arg: &Arg) -> Vec<OsString> {
        let given = self.0.iter().find(|(id, _)| arg.get_id() == id.as_str());
        let (Some((_, values)), Some(name)) = (given, arg.get_long()) else { return Vec::new() };
        if matches!(arg.get_action(), ArgAction::SetTrue) {
            return vec![format!("--{name}").into()];
        }
        let word = |value: &OsString| {
            let mut word = OsString::from(format!("--{name}="));
            word.push(value);
            word
        };
        values.iter().map(word).collect()
    }
}

impl FromArgMatches for GivenFlags {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let given = matches.ids().map(|id| id.as_str());
        let given = given.filter(|id| matches.value_source(id) == Some(ValueSource::CommandLine));
        let values = |id: &str| matches.get_raw(id).into_iter().flatten().map(OsString::from).collect();
        Ok(Self(given.map(|id| (id.to_owned(), values(id))).collect()))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

impl Args for GivenFlags {
    fn augment_args(command: Command) -> Command {
        command
    }

    fn augment_args_for_update(command: Command) -> Command {
        command
    }
}
