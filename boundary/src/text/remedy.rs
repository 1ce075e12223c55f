//! Remedies: options, commands and entries of a model file that the library recommends, as values.

/// Declares an enum whose variants each have one name.
macro_rules! names {
    ($(#[$about:meta])* $type:ident { $($(#[$doc:meta])* $variant:ident => $name:literal,)+ }) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $type {
            $($(#[$doc])* $variant,)+
        }

        impl $type {
            /// All variants.
            pub const ALL: &[Self] = &[$(Self::$variant,)+];

            /// The name in the library.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name,)+
                }
            }
        }
    };
}

names! {
    /// Options in messages. A front end without such an option does not compile or fails a test of its own.
    OptionName {
        /// Effects that the model has when others are distinguished.
        Beside => "beside",
        /// The time interval of a recording that is read.
        Between => "between",
        /// Validation recordings, which a fit does not use.
        Check => "check",
        /// Names of the model for columns of a recording.
        Columns => "columns",
        /// Cut-off of the low-pass on positions.
        CutoffHz => "cutoff_hz",
        /// Recordings.
        Data => "data",
        /// Keeps every n-th sample.
        Decimate => "decimate",
        /// Removes parameters that a recording does not determine.
        Essential => "essential",
        /// Effects from which one is distinguished.
        From => "from",
        /// Fixes parameters at their nominal values.
        Held => "held",
        /// Recordings that serve as instruments.
        Instruments => "instruments",
        /// Masses and inertias of a robot description are known numbers.
        KnownBodies => "known_bodies",
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
        /// The file for a result.
        Out => "out",
        /// Values of the base parameters.
        Parameters => "parameters",
        /// Period of a motion.
        Period => "period",
        /// Parameters that are physically possible.
        Physical => "physical",
        /// A picture of the mechanism.
        Picture => "picture",
        /// The plan of a reduction.
        Plan => "plan",
        /// Uses nominal values as measurements with a standard deviation.
        Prior => "prior",
        /// Samples per second.
        Rate => "rate",
        /// Weights that limit the effect of outliers.
        Robust => "robust",
        /// Rounds angles that are near simple fractions of a turn.
        RoundAngles => "round_angles",
        /// An effect that a motion distinguishes from others.
        Separate => "separate",
        /// Leaves out samples without a number.
        SkipBadSamples => "skip_bad_samples",
        /// How positions are smoothed.
        Smoothing => "smoothing",
        /// The source of rates and accelerations.
        Source => "source",
        /// Leaves out equations of drives at standstill.
        Standstill => "standstill",
        /// Largest gap that joints may have.
        Tolerance => "tolerance",
        /// Numbers of samples removed at the start and at the end.
        Trim => "trim",
        /// Physical parameters that are computed from base parameters.
        Unknown => "unknown",
        /// Weights of equations.
        Weights => "weights",
    }
}

names! {
    /// Commands in messages.
    CommandName {
        /// Writes a fit into a model file.
        Adopt => "adopt",
        /// Checks whether a model is consistent.
        Check => "check",
        /// Finds the effects that a model lacks.
        Diagnose => "diagnose",
        /// Computes the forces of a model along a motion.
        Evaluate => "evaluate",
        /// Plans a motion.
        Excite => "excite",
        /// Identifies the base parameters.
        Identify => "identify",
    }
}

/// An option, with a value if one is recommended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OptionSetting {
    /// The option.
    pub name: OptionName,
    /// Its value; `None` if any value is possible, or the option has none.
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

/// A recommendation to the reader.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Remedy {
    /// Options to be given together, or to be omitted.
    Options(Vec<OptionSetting>),
    /// A command to be run.
    Command(CommandName),
    /// An entry of the model file to be checked or written, such as `gravity` or `[limits.coordinates]`.
    Edit(&'static str),
}

impl Remedy {
    /// An option without a value.
    pub fn option(name: OptionName) -> Self {
        Self::Options(vec![OptionSetting { name, value: None }])
    }

    /// Several options with their values.
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

    /// Sets the value of the last option; other remedies stay unchanged.
    #[must_use]
    pub fn with_value(mut self, value: impl Into<String>) -> Self {
        if let Self::Options(settings) = &mut self
            && let Some(setting) = settings.last_mut()
        {
            setting.value = Some(value.into());
        }
        self
    }

    /// The remedy written for the reader's front end.
    pub fn format_for(&self, wording: &dyn RemedyWording) -> String {
        match self {
            Self::Options(settings) => wording.format_options(settings),
            Self::Command(command) => wording.format_command(*command),
            Self::Edit(entry) => wording.format_edit(entry),
        }
    }
}

/// How a front end writes remedies: flags and commands of the program, keywords and methods of a notebook.
pub trait RemedyWording {
    /// Writes options that are given together.
    fn format_options(&self, settings: &[OptionSetting]) -> String;

    /// Writes a command.
    fn format_command(&self, command: CommandName) -> String;

    /// Writes an entry of the model file.
    fn format_edit(&self, entry: &str) -> String {
        format!("`{entry}` in the model file")
    }
}

/// The wording for callers of the Rust library `modelmill`.
#[derive(Clone, Copy, Debug, Default)]
pub struct RustWording;

impl RemedyWording for RustWording {
    fn format_options(&self, settings: &[OptionSetting]) -> String {
        let one = |setting: &OptionSetting| {
            let name = setting.name.name();
            match &setting.value {
                None => format!("option `{name}`"),
                Some(value) => format!("option `{name}` = `{value}`"),
            }
        };
        settings.iter().map(one).collect::<Vec<_>>().join(" ")
    }

    fn format_command(&self, command: CommandName) -> String {
        format!("verb `{}`", command.name())
    }
}
