//! What the library advises: options, commands and entries of a model file, as values that each front end spells.

/// Makes an enum of names that are written in one way only.
macro_rules! names {
    ($(#[$about:meta])* $type:ident { $($(#[$doc:meta])* $variant:ident => $name:literal,)+ }) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $type {
            $($(#[$doc])* $variant,)+
        }

        impl $type {
            /// All there are.
            pub const ALL: &[Self] = &[$(Self::$variant,)+];

            /// The library's own name.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name,)+
                }
            }
        }
    };
}

names! {
    /// Options that messages advise. A front end that has no such option does not compile or fails a test of its own.
    OptionName {
        /// Effects that are present in either case, while others are distinguished.
        Beside => "beside",
        /// Which part of a recording is read, by its times.
        Between => "between",
        /// Validation runs, which a fit does not use.
        Check => "check",
        /// Maps columns of a recording to names of the model.
        Columns => "columns",
        /// Cut-off of the low-pass on positions.
        CutoffHz => "cutoff_hz",
        /// Recordings.
        Data => "data",
        /// Keeps every n-th sample.
        Decimate => "decimate",
        /// Removes parameters that a recording does not determine.
        Essential => "essential",
        /// Effects that one effect may be confused with.
        From => "from",
        /// Fixes parameters at their nominal values.
        Held => "held",
        /// Recordings that serve as instruments.
        Instruments => "instruments",
        /// Leaves out forces of contacts and pushes.
        LeaveOutEvents => "leave_out_events",
        /// Limits of a motion.
        Limits => "limits",
        /// Known payloads of runs.
        Loads => "loads",
        /// Size of the noise in forces.
        Noise => "noise",
        /// Order of the low-pass.
        Order => "order",
        /// The file that a result is written to.
        Out => "out",
        /// Values of the base parameters.
        Parameters => "parameters",
        /// Period of a motion.
        Period => "period",
        /// Restricts parameters to bodies that are physically possible.
        Physical => "physical",
        /// A picture of the mechanism.
        Picture => "picture",
        /// The plan of a reduction.
        Plan => "plan",
        /// Uses nominal values as measurements with a standard deviation.
        Prior => "prior",
        /// Samples per second.
        Rate => "rate",
        /// Reduces the weight of outliers (Huber).
        Robust => "robust",
        /// Rounds angles that nearly are whole fractions of a revolution.
        RoundAngles => "round_angles",
        /// An effect that a planned motion distinguishes from others.
        Separate => "separate",
        /// Skips samples with missing or non-finite values.
        SkipBadSamples => "skip_bad_samples",
        /// How positions are smoothed.
        Smoothing => "smoothing",
        /// The source of rates and accelerations: columns or differentiated positions.
        Source => "source",
        /// Excludes equations of drives at standstill.
        Standstill => "standstill",
        /// Numbers of samples removed at the start and at the end.
        Trim => "trim",
        /// Physical parameters that are computed from base parameters.
        Unknown => "unknown",
        /// Weights of equations.
        Weights => "weights",
    }
}

names! {
    /// Commands that messages advise.
    CommandName {
        /// Writes a fit into a model file.
        Adopt => "adopt",
        /// Validates a model file.
        Check => "check",
        /// Reports which effects a model lacks.
        Diagnose => "diagnose",
        /// Computes the forces of a model along a motion.
        Evaluate => "evaluate",
        /// Plans a motion.
        Excite => "excite",
        /// Identifies the base parameters.
        Identify => "identify",
    }
}

/// An option, with its value where one is advised.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OptionSetting {
    /// The option.
    pub name: OptionName,
    /// Its value; `None` where any would do, or it takes none.
    pub value: Option<String>,
}

impl OptionSetting {
    /// An option with a value.
    pub fn new(name: OptionName, value: impl Into<String>) -> Self {
        Self {
            name,
            value: Some(value.into()),
        }
    }
}

/// One piece of advice to a reader.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Remedy {
    /// Options to be given together, or left out.
    Options(Vec<OptionSetting>),
    /// A command to be run.
    Command(CommandName),
    /// An entry of the model file to be looked at or written, such as `gravity` or `[limits.coordinates]`.
    Edit(&'static str),
}

impl Remedy {
    /// An option.
    pub fn option(name: OptionName) -> Self {
        Self::Options(vec![OptionSetting { name, value: None }])
    }

    /// Options with their values, side by side.
    pub fn options(settings: impl IntoIterator<Item = OptionSetting>) -> Self {
        Self::Options(settings.into_iter().collect())
    }

    /// A command.
    pub fn command(name: CommandName) -> Self {
        Self::Command(name)
    }

    /// An entry of the model file.
    pub fn edit(entry: &'static str) -> Self {
        Self::Edit(entry)
    }

    /// Gives the last option a value.
    #[must_use]
    pub fn with_value(mut self, value: impl Into<String>) -> Self {
        if let Self::Options(settings) = &mut self
            && let Some(setting) = settings.last_mut()
        {
            setting.value = Some(value.into());
        }
        self
    }

    /// The remedy in the words of whoever reads it.
    pub fn spell(&self, spelling: &dyn RemedySpelling) -> String {
        match self {
            Self::Options(settings) => spelling.spell_options(settings),
            Self::Command(command) => spelling.spell_command(*command),
            Self::Edit(entry) => spelling.spell_edit(entry),
        }
    }
}

/// How a front end asks for what messages advise: flags and commands of the program, keywords and methods of a notebook.
pub trait RemedySpelling {
    /// Options that are given together.
    fn spell_options(&self, settings: &[OptionSetting]) -> String;

    /// A command.
    fn spell_command(&self, command: CommandName) -> String;

    /// An entry of the model file.
    fn spell_edit(&self, entry: &str) -> String {
        format!("`{entry}` in the model file")
    }
}

/// The words of the library, for those who call it from Rust.
#[derive(Clone, Copy, Debug, Default)]
pub struct LibrarySpelling;

impl RemedySpelling for LibrarySpelling {
    fn spell_options(&self, settings: &[OptionSetting]) -> String {
        let one = |setting: &OptionSetting| {
            let name = setting.name.name();
            match &setting.value {
                None => format!("option `{name}`"),
                Some(value) => format!("option `{name}` = `{value}`"),
            }
        };
        settings.iter().map(one).collect::<Vec<_>>().join(" ")
    }

    fn spell_command(&self, command: CommandName) -> String {
        format!("verb `{}`", command.name())
    }
}
