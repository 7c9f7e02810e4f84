//! What an hour of the machine and of a person costs.

use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::Fault;
use crate::diag::Diag;
use crate::units::{number_and_unit, quantity_from_text};

/// What an hour costs. Both rates are in one currency.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cost {
    /// An hour of the machine; the currency by its three letters, 0 to 1e6 an hour.
    #[schemars(extend("x-value" = "money per hour, such as \"80 EUR/h\""))]
    pub machine: Rate,
    /// An hour of the person who attends it, in the same currency; without it a person costs nothing, as where one
    /// attends many closed machines.
    #[schemars(extend("x-value" = "money per hour"))]
    #[serde(default)]
    pub operator: Option<Rate>,
}

impl Cost {
    /// Cost of a job that takes `total_s`, loading included, in the currency. Whoever loads the blocks, a person attends
    /// the machine as long as it marks: none of these lasers may be left alone.
    pub fn of(&self, total_s: f64) -> f64 {
        let operator = self.operator.map_or(0.0, |rate| rate.per_h);
        (self.machine.per_h + operator) * total_s / 3600.0
    }

    /// The currency of both rates.
    pub fn currency(&self) -> String {
        self.machine.currency()
    }

    pub(super) fn faults(&self) -> Vec<Fault> {
        let mut out = Vec::new();
        for (key, rate) in [("cost.machine", Some(self.machine)), ("cost.operator", self.operator)] {
            if rate.is_some_and(|rate| !(0.0..=MOST).contains(&rate.per_h)) {
                let text = format!("{key} is not between 0 and 1e6 an hour");
                out.push((key.to_owned(), Diag::input("machine-cost", text).hint("give the cost of one hour")));
            }
        }
        if let Some(operator) = self.operator.filter(|operator| operator.currency != self.machine.currency) {
            let text = format!("cost.operator is in {}, cost.machine in {}", operator.currency(), self.currency());
            let fault = Diag::input("machine-cost", text).hint("give both in one currency");
            out.push(("cost.operator".to_owned(), fault));
        }
        out
    }
}

/// Highest rate that is accepted.
const MOST: f64 = 1e6;

/// Money per hour: `"80 EUR/h"`, the currency by its three letters (ISO 4217).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rate {
    per_h: f64,
    currency: [u8; 3],
}

/// What messages call a rate, and how they show one.
const WHAT: &str = "hourly rate";
const EXAMPLE: &str = "80 EUR/h";

impl Rate {
    fn currency(&self) -> String {
        self.currency.map(char::from).iter().collect()
    }
}

impl FromStr for Rate {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let (per_h, unit) = number_and_unit(text, WHAT, EXAMPLE)?;
        // Any three capital letters are taken as a currency; there is no list of them here.
        let currency = unit.strip_suffix("/h").and_then(|letters| <[u8; 3]>::try_from(letters.as_bytes()).ok());
        match currency.filter(|letters| letters.iter().all(u8::is_ascii_uppercase)) {
            Some(currency) => Ok(Self { per_h, currency }),
            None => {
                Err(format!("{text:?} is not money per hour; write it as {EXAMPLE:?}, the currency in three letters"))
            }
        }
    }
}

impl fmt::Display for Rate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}/h", self.per_h, self.currency())
    }
}

impl Serialize for Rate {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        s.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Rate {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        quantity_from_text(d, WHAT, EXAMPLE)
    }
}

impl schemars::JsonSchema for Rate {
    fn schema_name() -> Cow<'static, str> {
        "Rate".into()
    }
    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({
            "type": "string",
            "description": format!("Text: money per hour, the currency in three letters, for example {EXAMPLE:?}."),
            "pattern": "^\\s*[-+]?([0-9]+[.]?[0-9]*|[.][0-9]+)([eE][-+]?[0-9]+)?\\s*[A-Z]{3}/h\\s*$",
            "examples": [EXAMPLE],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::{Machine, PROFILES};

    fn parsed(cost: &str) -> Result<Machine, crate::diag::Error> {
        Machine::parse("m.toml", &format!("{}\n[cost]\n{cost}\n", PROFILES[0].1))
    }

    #[test]
    fn cost_is_time_times_the_rates_of_machine_and_operator() {
        let machine = parsed("machine = \"80 EUR/h\"\noperator = \"45.5EUR/h\"").expect("a machine");
        let cost = machine.cost.expect("rates");
        assert_eq!(cost.of(1800.0), 40.0 + 22.75);
        assert_eq!(cost.currency(), "EUR");
        let alone = parsed("machine = \"80 EUR/h\"").expect("a machine").cost.expect("a rate");
        assert_eq!(alone.of(1800.0), 40.0);
        let text = serde_json::to_string(&cost).expect("JSON");
        assert_eq!(serde_json::from_str::<Cost>(&text).expect("the same"), cost, "{text}");
    }

    #[test]
    fn rates_without_currency_of_two_currencies_or_beyond_the_range_are_refused() {
        for bad in ["\"80\"", "80", "\"80 /h\"", "\"80 euro/h\"", "\"80 eur/h\"", "\"80 EUR\"", "\"80 EUR/min\""] {
            let e = parsed(&format!("machine = {bad}")).expect_err(bad).to_string();
            assert!(e.contains("80 EUR/h"), "{bad}: {e}");
        }
        for (bad, said) in [
            ("machine = \"-1 EUR/h\"", "cost.machine is not between"),
            ("machine = \"1.1e6 EUR/h\"", "cost.machine is not between"),
            ("machine = \"80 EUR/h\"\noperator = \"45 CHF/h\"", "cost.operator is in CHF, cost.machine in EUR"),
        ] {
            let e = parsed(bad).expect_err(bad);
            assert!(e.diags().len() == 1 && e.diags()[0].code == "machine-cost", "{e}");
            assert!(e.to_string().contains(said), "{e}");
        }
    }
}
