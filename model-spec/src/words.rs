//! Types with a fixed choice of words: the words of the file and the variants of the enum are one list.

/// Declares such a type with its reader and its JSON Schema. The schema's name is that of the type or the one behind
/// `as`.
macro_rules! words {
    (
        $(#[$about:meta])*
        $visible:vis $name:ident $(as $schema:literal)?: $expected:literal,
        $($(#[$says:meta])* $word:literal => $variant:ident),* $(,)?
    ) => {
        // The enum itself.
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        $visible enum $name {
            $($(#[$says])* $variant),*
        }

        // The reader: an unknown word is reported with all words and the nearest one.
        impl $crate::record::SchemaValue for $name {
            const EXPECTED: &'static str = $expected;
            const EXAMPLE: &'static str = concat!("\"", $crate::record::first!($($word),*), "\"");

            fn read(node: &$crate::document::TomlNode, log: &mut $crate::diagnostic::DiagnosticLog) -> Option<Self> {
                let $crate::document::TomlValue::Text { text, .. } = &node.value else {
                    return $crate::record::wrong_type::<Self>(node, log);
                };
                match text.as_str() {
                    $($word => Some(Self::$variant),)*
                    _ => {
                        log.push(
                            $crate::diagnostic::Diagnostic::error(
                                node.span,
                                format!("`{}` is not {}", $crate::document::quote(text), $expected),
                            )
                            .label(format!("expected one of {}", [$(concat!("`", $word, "`")),*].join(", ")))
                            .help_if($crate::suggest::nearest(text, [$($word),*])
                                .map(|near| format!("did you mean `{near}`?"))),
                        );
                        None
                    }
                }
            }
        }

        // The JSON Schema lists the words; descriptions of variants are not part of it.
        #[cfg(any(test, feature = "schema"))]
        impl schemars::JsonSchema for $name {
            fn schema_name() -> std::borrow::Cow<'static, str> {
                $crate::record::first!($($schema,)? (stringify!($name))).into()
            }

            fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
                schemars::json_schema!({ "enum": [$($word),*] })
            }
        }
    };
}
pub(crate) use words;
