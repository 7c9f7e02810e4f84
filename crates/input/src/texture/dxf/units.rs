//! The length of a drawing unit.

use terrace_core::diag::Diag;

/// Name and length in mm by the number in $INSUNITS; 0 is not a unit.
const UNITS: [(&str, f64); 25] = [
    ("none", 0.0),
    ("inch", 25.4),
    ("foot", 304.8),
    ("mile", 1_609_344.0),
    ("mm", 1.0),
    ("cm", 10.0),
    ("m", 1000.0),
    ("km", 1e6),
    ("microinch", 25.4e-6),
    ("mil", 0.0254),
    ("yard", 914.4),
    ("angstrom", 1e-7),
    ("nm", 1e-6),
    ("um", 1e-3),
    ("dm", 100.0),
    ("dam", 1e4),
    ("hm", 1e5),
    ("Gm", 1e12),
    ("astronomical unit", 149_597_870_700_000.0),
    ("light year", 9_460_730_472_580_800_000.0),
    ("parsec", 3.085_677_581_491_367e19),
    ("US survey foot", 1_200_000.0 / 3937.0),
    ("US survey inch", 100_000.0 / 3937.0),
    ("US survey yard", 3_600_000.0 / 3937.0),
    ("US survey mile", 6_336_000_000.0 / 3937.0),
];

/// The unit in mm: what the file says, or what the job says where the file says nothing. Both may say the same.
pub(super) fn unit_mm(in_file: Option<i64>, in_job: Option<f64>) -> Result<f64, Box<Diag>> {
    let row = match in_file {
        None | Some(0) => None,
        Some(code) => Some(usize::try_from(code).ok().and_then(|i| UNITS.get(i)).ok_or_else(|| {
            Diag::input("dxf-unit", format!("the drawing's unit ($INSUNITS) is {code}, which is not known"))
                .hint("save it with units of mm, or set $INSUNITS to 0 and give the texture a unit")
        })?),
    };
    match (row, in_job) {
        (Some((_, mm)), None) => Ok(*mm),
        (None, Some(mm)) => Ok(mm),
        (Some((name, mm)), Some(job)) => {
            if (mm / job - 1.0).abs() < 1e-9 {
                return Ok(*mm);
            }
            let text = format!("a unit of the drawing is {mm} mm ({name}, by $INSUNITS), but {job} mm by the job");
            Err(Diag::input("dxf-unit", text)
                .hint("remove unit from the texture, or correct the unit in the drawing program")
                .into())
        }
        (None, None) => Err(Diag::input("dxf-unit", "the drawing does not say what its unit is ($INSUNITS)")
            .hint("add unit = \"mm\" (or \"in\") to the texture")
            .into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn file_or_job_says_the_unit_and_both_must_agree() {
        assert_eq!(unit_mm(Some(1), None), Ok(25.4));
        assert_eq!(unit_mm(Some(0), Some(2.0)), Ok(2.0));
        assert_eq!(unit_mm(None, Some(2.0)), Ok(2.0));
        assert_eq!(unit_mm(Some(4), Some(1.0)), Ok(1.0));
        for (file, job, says) in [
            (None, None, "unit = "),
            (Some(0), None, "unit = "),
            (Some(4), Some(25.4), "remove unit"),
            (Some(2), Some(1_200_000.0 / 3937.0), "remove unit"),
            (Some(25), Some(1.0), "$INSUNITS"),
            (Some(-1), None, "$INSUNITS"),
        ] {
            let d = unit_mm(file, job).expect_err("no unit");
            assert!(d.code == "dxf-unit" && d.hint.contains(says), "{d}");
        }
    }
}
