//! Forces, power and limits of two variants along the same motions, as JSON for scripts and as text for people.

use serde_json::{Value, json};

use crate::print::{RemedyWording, notes, tables};
use crate::text::TerminalStyle;
use crate::text::table::{ColumnAlignment, count, number, percent, significant, table};
use crate::variants::{DriveEffort, DriveVariants, LimitCrossing, LimitUse, TermShare, VariantComparison};

/// Terms of a drive's difference that are shown at most; the others are added up in one line.
const MOST_TERMS: usize = 6;
/// Relative changes up to this are rounding and print as none.
const UNCHANGED: f64 = 5e-6;
/// Products of p_g that are named, at most.
const MOST_PRODUCTS: usize = 4;
/// Terms below this share of the largest one are not shown separately.
const LEAST_SHARE: f64 = 0.01;

impl VariantComparison {
    /// All figures as one JSON object, `before` and `after` for the two variants.
    ///
    /// - `drives`: peak and rms force (N or N m), peak and rms power (W), positive and net work (J), and the
    ///   terms that cause the difference; their shares sum to 1, and `by_value` is the part of a share that
    ///   comes from the new value
    /// - `limits`: range of each limit, and the fraction of it that is used (1 at the limit)
    /// - `errors`: relative to measured forces, if the recordings have them
    pub fn json(&self, wording: &dyn RemedyWording) -> Value {
        // Limits with the range in both files and the use by both models.
        let limits = self.limits.iter().map(|one| {
            let side = |m: usize| json!({ "range": one.ranges[m], "used": one.used[m] });
            json!({
                "limit": one.limit,
                "crossing": crossing(one.crossing()),
                "before": side(0),
                "after": side(1),
            })
        });
        json!({
            "recordings": self.recordings,
            "samples": self.samples,
            "seconds": self.seconds,
            "drives": self.drives.iter().map(drive).collect::<Vec<_>>(),
            "limits": limits.collect::<Vec<_>>(),
            "errors": { "before": self.errors[0], "after": self.errors[1] },
            "notes": notes(&self.notes, wording),
        })
    }

    /// The comparison as text, without its notes.
    pub fn text(&self, style: TerminalStyle) -> String {
        // The motion on which both variants are compared.
        let mut lines = vec![style.bold(&format!(
            "along {}: {} in {} s",
            self.recordings.join(", "),
            count(self.samples, "sample", "samples"),
            significant(self.seconds, 3)
        ))];
        lines.push(String::new());
        // Figures of both variants and their change.
        lines.push(style.bold("Forces and power of the drives"));
        lines.extend(efforts(&self.drives));
        lines.push(String::new());
        // The terms that cause the difference, drive by drive.
        lines.push(style.bold("Causes of the difference"));
        for drive in &self.drives {
            lines.extend(shares(drive));
        }
        lines.push(String::new());
        // Exceeded limits, and the most used of the others.
        lines.push(style.bold("Limits"));
        lines.extend(self.limits_text(style));
        // Errors exist only if the recordings have forces.
        if self.errors.iter().any(Option::is_some) {
            lines.push(String::new());
            lines.push(style.bold("Error relative to the measured forces"));
            let named = ["before", "after"].into_iter().zip(&self.errors);
            let named = named.filter_map(|(name, figures)| Some((name, figures.as_ref()?)));
            lines.extend(tables::figures(&named.collect::<Vec<_>>()));
        }
        lines.join("\n")
    }

    /// Limits that are exceeded by either variant, one line each, and a count of the others.
    fn limits_text(&self, style: TerminalStyle) -> Vec<String> {
        if self.limits.is_empty() {
            return vec!["  the files have no `[limits]`".to_owned()];
        }
        let mut lines = Vec::new();
        // The worst changes come first.
        for crossing in [
            LimitCrossing::NowExceeded,
            LimitCrossing::StillExceeded,
            LimitCrossing::NoLongerExceeded,
        ] {
            for one in self.limits.iter().filter(|l| l.crossing() == crossing) {
                let line = format!("  {}", limit_line(one));
                lines.push(match crossing {
                    LimitCrossing::NowExceeded => style.red(&line),
                    LimitCrossing::StillExceeded | LimitCrossing::Kept => line,
                    LimitCrossing::NoLongerExceeded => style.green(&line),
                });
            }
        }
        let kept = self.limits.iter().filter(|l| l.crossing() == LimitCrossing::Kept);
        // Of the limits that both variants keep, only the one nearest to its end is named.
        let most = kept.clone().max_by(|a, b| {
            let used = |one: &LimitUse| one.used.into_iter().flatten().fold(0.0, f64::max);
            used(a).total_cmp(&used(b))
        });
        if let Some(most) = most {
            lines.push(format!(
                "  within: {}; the most used is {}",
                count(kept.count(), "limit", "limits"),
                limit_line(most)
            ));
        }
        lines
    }
}

/// The name of a limit's state in the JSON.
fn crossing(crossing: LimitCrossing) -> &'static str {
    match crossing {
        LimitCrossing::NowExceeded => "now_exceeded",
        LimitCrossing::StillExceeded => "still_exceeded",
        LimitCrossing::NoLongerExceeded => "no_longer_exceeded",
        LimitCrossing::Kept => "kept",
    }
}

/// A drive as JSON.
fn drive(one: &DriveVariants) -> Value {
    // Units are N or N m, W and J.
    let effort = |effort: &DriveEffort| {
        let [peak, rms, peak_power, rms_power, work, net_work] = numbers(effort);
        json!({
            "peak": peak,
            "rms": rms,
            "peak_power": peak_power,
            "rms_power": rms_power,
            "work": work,
            "net_work": net_work,
        })
    };
    // A term with its values in both models and its share.
    let term = |term: &TermShare| {
        json!({
            "term": term.term,
            "retained": term.retained,
            "unit": term.unit,
            "before": term.before,
            "after": term.after,
            "share": term.share,
            "by_value": term.by_value,
        })
    };
    // Terms are grouped by their product of parameters.
    let products = one.products.iter().map(|product| {
        json!({
            "product": product.product,
            "share": product.share,
            "terms": product.terms.iter().map(term).collect::<Vec<_>>(),
        })
    });
    json!({
        "drive": one.drive,
        "unit": one.unit,
        "before": effort(&one.before),
        "after": effort(&one.after),
        "difference": { "peak": one.difference.peak, "rms": one.difference.rms },
        "products": products.collect::<Vec<_>>(),
    })
}

/// One line of a limit: what each model uses of it.
fn limit_line(one: &LimitUse) -> String {
    // A model without this limit has no share.
    let used = one.used.map(|used| used.map_or_else(|| "no limit".to_owned(), part));
    let range = |m: usize| one.ranges[m].map(|[low, high]| format!("{} to {}", number(low), number(high)));
    // Equal ranges are printed once.
    let range = match (range(0), range(1)) {
        (Some(a), Some(b)) if a == b => format!(" ({a})"),
        (None, None) => String::new(),
        (a, b) => {
            let text = |range: Option<String>| range.unwrap_or_else(|| "none".to_owned());
            format!(" ({}, then {})", text(a), text(b))
        }
    };
    // The state in words, in front of both shares.
    let says = match one.crossing() {
        LimitCrossing::NowExceeded => "is now exceeded: ",
        LimitCrossing::StillExceeded => "is exceeded by both: ",
        LimitCrossing::NoLongerExceeded => "is no longer exceeded: ",
        LimitCrossing::Kept => "",
    };
    format!("{}{range} {says}{} -> {}", one.limit, used[0], used[1])
}

/// The part of a limit that is used; close to the limit with more digits, which say on which side.
fn part(used: f64) -> String {
    // Next to 100 % three digits would not show on which side a value is.
    let digits = if (used - 1.0).abs() < 0.01 { 6 } else { 3 };
    format!("{} %", significant(100.0 * used, digits))
}

/// Figures of all drives, three lines each: before, after, and the change.
fn efforts(drives: &[DriveVariants]) -> Vec<String> {
    let mut rows = Vec::new();
    for one in drives {
        // The unit follows the forces; powers and work have theirs in the head.
        let row = |drive: &str, which: &str, cells: [String; 6]| {
            let mut row = vec![drive.to_owned(), which.to_owned()];
            row.extend(cells);
            row.insert(4, one.unit.to_owned());
            row
        };
        // Four digits show changes that matter.
        let shown = |effort: &DriveEffort| numbers(effort).map(|x| significant(x, 4));
        rows.push(row(&one.drive, "before", shown(&one.before)));
        rows.push(row("", "after", shown(&one.after)));
        let (before, after) = (numbers(&one.before), numbers(&one.after));
        let changes = std::array::from_fn(|i| change(before[i], after[i]));
        let mut row = row("", "change", changes);
        row[4].clear();
        rows.push(row);
    }
    table(
        2,
        &[
            ("drive", ColumnAlignment::Left),
            ("", ColumnAlignment::Left),
            ("peak", ColumnAlignment::Right),
            ("rms", ColumnAlignment::Right),
            ("", ColumnAlignment::Left),
            ("peak, W", ColumnAlignment::Right),
            ("rms, W", ColumnAlignment::Right),
            ("positive work, J", ColumnAlignment::Right),
            ("net work, J", ColumnAlignment::Right),
        ],
        &rows,
    )
}

/// Peak and rms force (N or N m), peak and rms power (W), positive and net work (J).
fn numbers(effort: &DriveEffort) -> [f64; 6] {
    let DriveEffort {
        peak,
        rms,
        peak_power,
        rms_power,
        work,
        net_work,
    } = *effort;
    [peak, rms, peak_power, rms_power, work, net_work]
}

/// A change relative to what was, `+12.3 %`.
fn change(before: f64, after: f64) -> String {
    let by = after - before;
    // A change of rounding prints as a dash.
    if by.abs() <= UNCHANGED * before.abs() {
        return "-".to_owned();
    }
    // A change from zero has no percentage.
    let sign = if by > 0.0 { "+" } else { "-" };
    if before == 0.0 {
        return format!("{sign}{}", significant(by.abs(), 4));
    }
    format!("{sign}{}", percent(Some((by / before).abs())))
}

/// Terms that cause the difference of a drive, the largest first.
fn shares(one: &DriveVariants) -> Vec<String> {
    // The size of the difference gives the shares a meaning.
    let size = one.difference;
    if one.products.is_empty() {
        return vec![format!("  {}: no difference", one.drive)];
    }
    let mut lines = vec![format!(
        "  {}: difference {} {unit} at most, {} {unit} rms",
        one.drive,
        significant(size.peak, 4),
        significant(size.rms, 4),
        unit = one.unit
    )];
    // Products show the causes in groups, terms show each of them.
    if one.products.len() > 1 {
        let least = LEAST_SHARE * one.products[0].share.abs();
        let large = (one.products.iter()).take_while(|p| p.share.abs() >= least);
        let most = large
            .clone()
            .take(MOST_PRODUCTS)
            .map(|p| format!("{} {}", p.product, signed_percent(p.share)));
        let more = if large.clone().count() > MOST_PRODUCTS {
            ", ..."
        } else {
            ""
        };
        let all: Vec<String> = most.collect();
        lines.push(format!("    by product of p_g: {}{more}", all.join(", ")));
    }
    // Shares may be negative, where a term reduces the difference.
    let mut terms: Vec<&TermShare> = one.products.iter().flat_map(|p| &p.terms).collect();
    terms.sort_by(|a, b| b.share.abs().total_cmp(&a.share.abs()));
    let least = terms.first().map_or(0.0, |first| LEAST_SHARE * first.share.abs());
    let shown = terms.iter().take_while(|term| term.share.abs() >= least);
    let n = shown.take(MOST_TERMS).count();
    let rows: Vec<Vec<String>> = (terms[..n].iter())
        .map(|term| {
            vec![
                signed_percent(term.share),
                term.term.clone(),
                if term.term == term.retained {
                    String::new()
                } else {
                    format!("in p_min of {}", term.retained)
                },
                value(term),
                column_share_text(term),
            ]
        })
        .collect();
    let columns = [
        ("", ColumnAlignment::Right),
        ("", ColumnAlignment::Left),
        ("", ColumnAlignment::Left),
        ("", ColumnAlignment::Left),
        ("", ColumnAlignment::Left),
    ];
    lines.extend(table(4, &columns, &rows).into_iter().skip(1));
    // The remaining terms are added up, so that the shares sum to 100 %.
    let rest: f64 = terms[n..].iter().map(|term| term.share).sum();
    if n < terms.len() {
        lines.push(format!(
            "    {} from {}",
            signed_percent(rest),
            count(terms.len() - n, "other term", "other terms")
        ));
    }
    lines
}

/// A share in per cent with its sign.
fn signed_percent(share: f64) -> String {
    // A positive share has no sign.
    let size = percent(Some(share.abs()));
    if share < 0.0 { format!("-{size}") } else { size }
}

/// Which part of a share comes from the changed geometry (the column) instead of the changed value; empty
/// without such a part.
fn column_share_text(term: &TermShare) -> String {
    let by_column = term.share - term.by_value;
    // A small rest is rounding of the split, not a change of geometry.
    if by_column.abs() <= LEAST_SHARE * term.share.abs() {
        String::new()
    } else if term.by_value == 0.0 {
        "from the changed geometry alone".to_owned()
    } else {
        format!(
            "{} from the new value, {} from the changed geometry",
            signed_percent(term.by_value),
            signed_percent(by_column)
        )
    }
}

/// Value of a term, and the one before.
fn value(term: &TermShare) -> String {
    // Numbers without unit stand alone.
    let unit = match term.unit.as_str() {
        "1" | "" => String::new(),
        unit => format!(" {unit}"),
    };
    match (term.before, term.after) {
        (Some(before), Some(after)) if number(before) == number(after) => {
            format!("{}{unit}", number(after))
        }
        (Some(before), Some(after)) => format!("{} -> {}{unit}", number(before), number(after)),
        (Some(before), None) => format!("removed: {}{unit}", number(before)),
        (None, after) => format!("added: {}{unit}", number(after.unwrap_or(0.0))),
    }
}
