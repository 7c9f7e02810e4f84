//! Hostile style sheets: each is read or refused in two seconds and 200 MB, and the time grows with the length.

use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use crate::support::{JobText, folder, said};

/// What a drawing may take; `CSS_BOMB_SECONDS` in the environment gives more to an unoptimised build.
const SECONDS: f64 = 2.0;

/// What of memory is resident at most, MB.
const MEGABYTES: u64 = 200;

/// Most parts of a bomb.
const MANY: usize = 100_000;
/// How deep a bomb nests.
const DEEP: usize = 100_000;

/// Name, style sheet and what the page holds.
struct Bomb {
    name: String,
    css: String,
    body: String,
}

const SQUARE: &str = "<rect class='a' x='1' y='1' width='9' height='9'/>";

fn bomb(name: &str, css: impl Into<String>) -> Bomb {
    with_body(name, css, SQUARE)
}

fn with_body(name: &str, css: impl Into<String>, body: impl Into<String>) -> Bomb {
    Bomb { name: name.into(), css: css.into(), body: body.into() }
}

/// So many of a text that holds its number in place of `#`.
fn numbered(text: &str, n: usize) -> String {
    let mut out = String::new();
    for i in 0..n {
        let (a, b) = text.split_once('#').expect("a place for the number");
        write!(out, "{a}{i}{b}").expect("memory");
    }
    out
}

/// Rows of groups, each within the one before.
fn nested_groups(n: usize, inner: &str) -> String {
    "<g class='a'>".repeat(n) + inner + &"</g>".repeat(n)
}

/// So many squares side by side: squares on top of each other are work of another kind.
fn squares(n: usize) -> String {
    let side = (n as f64).sqrt().ceil() as usize;
    let cell = 28.0 / side as f64;
    (0..n).fold(String::new(), |mut out, i| {
        let [x, y] = [i % side, i / side].map(|k| 1.0 + k as f64 * cell);
        write!(out, "<rect x='{x:.4}' y='{y:.4}' width='{0:.4}' height='{0:.4}'/>", cell / 2.0).expect("memory");
        out
    })
}

/// Each variable is twice the one before.
fn doubling(n: usize) -> String {
    (1..n).fold("--v0:none none;".to_owned(), |mut css, i| {
        write!(css, "--v{i}:var(--v{}) var(--v{});", i - 1, i - 1).expect("memory");
        css
    })
}

fn bombs() -> Vec<Bomb> {
    let row = |n: usize| "<g/>".repeat(n) + SQUARE;
    let open_close = |open: &str, close: &str, n: usize| open.repeat(n) + &close.repeat(n);
    vec![
        bomb("rules_within_rules", open_close("a{", "}", DEEP)),
        bomb("rules_within_rules_not_closed", "a{".repeat(DEEP)),
        bomb("selectors_within_rules", open_close("&.a{", "}", DEEP)),
        bomb("nested_rules_that_double", "a,b{".to_owned() + &open_close("& c,& d{", "}", 60) + "fill:red}"),
        bomb("ampersands_that_double", "rect{".to_owned() + &open_close("& & &{", "}", 200) + "}"),
        bomb("ampersands_in_is", "rect{".to_owned() + &open_close(":is(&,& &) &{", "}", 60) + "}"),
        bomb("one_selector_of_many_ampersands", "rect{".to_owned() + &"&".repeat(MANY) + "{fill:red}}"),
        bomb("brackets_in_a_value", format!("rect{{fill:{}}}", open_close("(", ")", DEEP))),
        bomb("brackets_in_a_value_not_closed", "rect{fill:".to_owned() + &"(".repeat(DEEP)),
        bomb("square_brackets_in_a_value", format!("rect{{fill:{}}}", open_close("[", "]", DEEP))),
        bomb("braces_in_a_value", format!("rect{{--x:{}}}", open_close("{", "}", DEEP))),
        bomb("mixed_brackets", format!("rect{{fill:{}}}", "([{".repeat(DEEP))),
        bomb("closing_brackets", "}])".repeat(DEEP) + "rect{fill:none}"),
        bomb("functions_in_a_value", format!("rect{{fill:{}red{}}}", "rgb(".repeat(DEEP), ")".repeat(DEEP))),
        bomb("calc_in_calc", format!("rect{{width:{}1px{}}}", "calc(".repeat(DEEP), ")".repeat(DEEP))),
        bomb("calc_of_many_terms", format!("rect{{width:calc(1px{})}}", " + 1px".repeat(MANY))),
        bomb("min_of_many", format!("rect{{width:min(1px{})}}", ",1px".repeat(MANY))),
        bomb(
            "colour_in_colour",
            format!("rect{{fill:{}red{}}}", "color-mix(in srgb,red,".repeat(10_000), ")".repeat(10_000)),
        ),
        bomb(
            "light_dark_in_light_dark",
            format!("rect{{fill:{}red{}}}", "light-dark(red,".repeat(10_000), ")".repeat(10_000)),
        ),
        bomb("fallback_in_fallback", format!("rect{{fill:{}red{}}}", "var(--x,".repeat(10_000), ")".repeat(10_000))),
        bomb("variables_that_double", format!("rect{{{}fill:var(--v63)}}", doubling(64))),
        with_body(
            "variables_that_double_on_the_way_down",
            format!("g,rect{{{}fill:var(--v15)}}", doubling(16)),
            nested_groups(200, SQUARE),
        ),
        with_body(
            "a_variable_that_grows_on_the_way_down",
            "g{--x:var(--x) var(--x)} svg{--x:a}",
            nested_groups(200, SQUARE),
        ),
        bomb(
            "a_chain_of_variables",
            format!(
                "rect{{--v0:none;{}fill:var(--v9999)}}",
                (1..10_000).fold(String::new(), |css, i| css + &format!("--v{i}:var(--v{});", i - 1))
            ),
        ),
        bomb(
            "a_circle_of_variables",
            format!(
                "rect{{--v0:var(--v9999);{}fill:var(--v9999)}}",
                (1..10_000).fold(String::new(), |css, i| css + &format!("--v{i}:var(--v{});", i - 1))
            ),
        ),
        with_body(
            "many_variables_on_many_elements",
            format!("svg{{{}}}", numbered("--v#:none;", 10_000)),
            nested_groups(100, &squares(2_000)),
        ),
        with_body("a_selector_of_many_types", "g ".repeat(MANY) + "rect{fill:none}", nested_groups(200, SQUARE)),
        with_body("a_selector_of_many_children", "g>".repeat(MANY) + "rect{fill:none}", nested_groups(200, SQUARE)),
        with_body("a_selector_of_many_siblings", "g~".repeat(1_000) + "rect{fill:none}", row(MANY)),
        bomb("a_compound_of_many_classes", "rect".to_owned() + &".a".repeat(MANY) + "{fill:none}"),
        bomb("a_list_of_many_selectors", "x,".repeat(MANY) + "rect{fill:none}"),
        with_body(
            "ancestors_that_are_tried_again",
            "x ".to_owned() + &"g ".repeat(40) + "rect{fill:none}",
            nested_groups(200, SQUARE),
        ),
        with_body("siblings_that_are_tried_again", "x~".to_owned() + &"g~".repeat(12) + "rect{fill:none}", row(5_000)),
        bomb("not_in_not", format!("rect{}.x{}{{fill:none}}", ":not(".repeat(DEEP), ")".repeat(DEEP))),
        bomb("is_in_is", format!("{}.a{}{{fill:none}}", ":is(".repeat(1_000), ")".repeat(1_000))),
        bomb("is_of_two_in_is", format!("{}.a{}{{fill:none}}", ":is(.x,".repeat(500), ")".repeat(500))),
        bomb("a_product_of_is", ":is(.a,.b) ".repeat(64) + "rect{fill:none}"),
        with_body("has_of_many", ":has(g) ".repeat(8) + "rect{fill:none}", nested_groups(200, &row(20_000))),
        with_body("has_of_a_chain", "g:has(g g g g g g g x){fill:none}", nested_groups(200, SQUARE)),
        with_body("has_of_siblings", "g:has(~ g ~ g ~ x){fill:none}", row(3_000)),
        with_body("nth_child_of_many", "g:nth-child(2n+1){fill:none}", row(MANY)),
        with_body("nth_last_child_of_many", "g:nth-last-child(2n+1){fill:none}", row(MANY)),
        with_body("nth_child_of_a_selector_of_many", "g:nth-child(2n+1 of .a,g){fill:none}", row(MANY)),
        with_body("nth_of_type_of_many", "g:nth-last-of-type(3n),g:nth-of-type(3n){fill:none}", row(MANY)),
        with_body(
            "last_child_and_only_of_type_of_many",
            "g:only-of-type,g:last-child,g:last-of-type,g:empty{fill:none}",
            row(MANY),
        ),
        bomb("a_long_attribute_selector", format!("[class='{}']{{fill:none}}", "a".repeat(4_000_000))),
        bomb("many_attribute_selectors", "rect".to_owned() + &"[class*='a' i]".repeat(MANY) + "{fill:none}"),
        with_body(
            "attributes_of_much_text",
            "[class*='aaaaaaaaab']".repeat(50) + "{fill:none}",
            format!("<rect width='9' height='9' class='{}'/>", "a".repeat(1_000_000)),
        ),
        with_body(
            "an_element_of_many_classes",
            ".a.b.c999999{fill:none}",
            format!("<rect width='9' height='9' class='{}'/>", numbered("c# ", 200_000)),
        ),
        bomb("comments", "/**/".repeat(1_000_000) + "rect{fill:none}"),
        bomb("a_comment_that_is_not_closed", "rect{fill:none}/*".to_owned() + &"*".repeat(4_000_000)),
        bomb("comments_that_begin", "rect{fill:none}".to_owned() + &"/*".repeat(2_000_000)),
        bomb("strings_that_are_not_closed", "rect{x:'\n".repeat(MANY)),
        bomb("a_url_that_is_not_closed", "rect{fill:url(".to_owned() + &"a".repeat(4_000_000)),
        bomb("escapes", format!(".{}{{fill:none}}", "\\61 ".repeat(500_000))),
        bomb("escapes_at_the_end", "rect{fill:none}".to_owned() + &"\\".repeat(2_000_000)),
        bomb(
            "numbers_of_many_digits",
            format!(
                "rect{{width:{}px;x:1e{};y:0.{}1px}}",
                "9".repeat(500_000),
                "9".repeat(500_000),
                "0".repeat(500_000)
            ),
        ),
        bomb("unicode_ranges_and_signs", "rect{fill:+-+-".to_owned() + &"+-".repeat(1_000_000) + "}"),
        bomb("many_rules", numbered(".c#{fill:red}", 250_000)),
        bomb("many_rules_that_apply", "rect{fill:red}".repeat(250_000)),
        bomb("many_declarations", format!("rect{{{}}}", "fill:red;".repeat(400_000))),
        bomb("many_faulty_declarations", format!("rect{{{}}}", "fill:red blue;".repeat(250_000))),
        bomb("many_unknown_declarations", format!("rect{{{}}}", numbered("p#:red;", 250_000))),
        bomb("media_in_media", open_close("@media all{", "}", DEEP)),
        bomb("media_of_many", format!("@media {}all{{rect{{fill:none}}}}", "not print,".repeat(MANY))),
        bomb(
            "media_conditions_in_brackets",
            format!("@media {}width{}{{rect{{fill:none}}}}", "(".repeat(DEEP), ")".repeat(DEEP)),
        ),
        bomb(
            "supports_in_brackets",
            format!("@supports {}fill:red{}{{rect{{fill:none}}}}", "(".repeat(DEEP), ")".repeat(DEEP)),
        ),
        bomb(
            "supports_not_not",
            format!("@supports {}(fill:red){}{{rect{{fill:none}}}}", "not (".repeat(DEEP), ")".repeat(DEEP)),
        ),
        bomb("layers_in_layers", open_close("@layer a{", "}", DEEP)),
        bomb("many_layers", numbered("@layer l#{rect{fill:red}}", 50_000)),
        bomb("a_layer_of_many_names", format!("@layer {}z;rect{{fill:none}}", "a.".repeat(MANY))),
        bomb("many_namespaces", numbered("@namespace n# 'x';", 50_000) + "rect{fill:none}"),
        bomb("unknown_at_rules", "@x y{z{}}".repeat(250_000)),
        with_body(
            "styles_of_many_elements",
            "rect{fill:red}",
            "<rect style='fill:red;fill:none;--x:var(--y)' width='1' height='1'/>".repeat(50_000),
        ),
        with_body(
            "a_style_of_many_declarations",
            "",
            format!("<rect width='9' height='9' style='{}'/>", "fill:red;".repeat(400_000)),
        ),
        with_body(
            "a_style_of_comments",
            "",
            format!("<rect width='9' height='9' style='{}fill:red'/>", "/**/".repeat(500_000)),
        ),
        with_body("many_sheets", "", "<style>rect{fill:none}</style>".repeat(20_000) + SQUARE),
        bomb("a_data_url_of_a_sheet", "@import url(data:text/css,rect{fill:none});".repeat(20_000)),
        with_body("important_on_all_sides", "*{fill:red!important}".repeat(1_000), nested_groups(200, &squares(500))),
        with_body("a_universal_rule_on_many", "* * *{fill:none}".repeat(100), nested_groups(100, &squares(2_000))),
    ]
}

/// What the program took of time and of memory, with what it said.
struct Taken {
    time: Duration,
    /// Seconds of the processor, whatever else the computer does.
    processor: f64,
    megabytes: u64,
    said: String,
    code: Option<i32>,
}

/// Checks a job on a plate with a drawing as its texture, on one thread.
fn taken(dir: &Path, bomb: &Bomb) -> Taken {
    let css = bomb.css.replace('&', "&amp;").replace('<', "&lt;");
    let text = format!(
        "<svg xmlns='http://www.w3.org/2000/svg' width='30mm' height='30mm' viewBox='0 0 30 30'><style>{css}</style>{}\
         <path d='M1 20H20' stroke='black'/></svg>",
        bomb.body
    );
    std::fs::write(dir.join("plate.obj"), "v 0 0 0\nv 50 0 0\nv 50 50 0\nv 0 50 0\nf 1 2 3 4\n").expect("writable");
    std::fs::write(dir.join("bomb.svg"), text).expect("writable");
    let job =
        JobText::on(&dir.join("plate.obj")).texture("file = \"bomb.svg\"\nfill = \"outline\"\nstroke = \"centre\"");
    let job = job.write(dir, "job.toml");
    let start = Instant::now();
    let mut child = Command::new(env!("CARGO_BIN_EXE_terrace"));
    let child = child.arg("check").arg(&job).args(["-j1", "--json"]).stdout(Stdio::piped()).stderr(Stdio::piped());
    let child = child.spawn().expect("the program starts");
    let id = child.id();
    let watch = std::thread::spawn(move || watched(id));
    let out = child.wait_with_output().expect("it ends");
    let time = start.elapsed();
    let (megabytes, processor) = watch.join().expect("figures");
    Taken { time, processor, megabytes, said: said(&out), code: out.status.code() }
}

/// Most MB that were resident of a process and seconds of the processor, of one that is followed until it ends and ended
/// where it takes many times what it may; 0 where the system does not say.
fn watched(id: u32) -> (u64, f64) {
    let (mut most, mut processor) = (0, 0.0);
    let start = Instant::now();
    while let Ok(status) = std::fs::read_to_string(format!("/proc/{id}/status")) {
        processor = processor_seconds(id).unwrap_or(processor);
        let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix(" kB"));
        // A process that has ended and is not yet waited for has no memory.
        let Some(kilobytes) = line.and_then(|n| n.trim().parse::<u64>().ok()) else { break };
        most = most.max(kilobytes / 1000);
        if start.elapsed().as_secs_f64() > 10.0 + 5.0 * seconds() || most > 20 * MEGABYTES {
            let _ = Command::new("kill").args(["-9", &id.to_string()]).status();
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    (most, processor)
}

/// Of the program itself, in a hundredth of a second (proc(5), stat: utime and stime).
fn processor_seconds(id: u32) -> Option<f64> {
    let stat = std::fs::read_to_string(format!("/proc/{id}/stat")).ok()?;
    // The name, in brackets, may hold blanks.
    let mut words = stat.rsplit_once(')')?.1.split_whitespace().skip(11);
    let mut ticks = || words.next()?.parse::<f64>().ok();
    Some((ticks()? + ticks()?) / 100.0)
}

fn seconds() -> f64 {
    std::env::var("CSS_BOMB_SECONDS").map_or(SECONDS, |text| text.parse().expect("a number"))
}

/// What is wrong with what a bomb takes, of three times where other work slows the computer down.
fn fault(dir: &Path, bomb: &Bomb) -> Option<String> {
    let fault = fault_of(bomb, &taken(dir, bomb))?;
    (0..2).try_fold(fault, |_, _| fault_of(bomb, &taken(dir, bomb)))
}

fn fault_of(bomb: &Bomb, taken: &Taken) -> Option<String> {
    let is_named = |code: &str| taken.said.contains(&format!("error[{code}"));
    let is_answered = match taken.code {
        Some(0) => true,
        Some(1 | 2) => is_named("svg-") || is_named("texture-") || is_named("memory"),
        _ => false,
    };
    let first = || taken.said.lines().next().unwrap_or_default().chars().take(120).collect::<String>();
    let time = taken.time.as_secs_f64();
    let is_right = is_answered && time <= seconds() && taken.megabytes <= MEGABYTES;
    (!is_right)
        .then(|| format!("{}: {time:.2} s, {} MB, exit {:?}: {}", bomb.name, taken.megabytes, taken.code, first()))
}

/// One program at a time: their times are compared with limits.
static ALONE: Mutex<()> = Mutex::new(());

#[test]
#[ignore = "slow: make test-all"]
fn hostile_style_sheets_take_two_seconds_and_200_mb_at_most() {
    let _alone = ALONE.lock();
    let bombs = bombs();
    assert!(bombs.len() >= 50, "{} bombs", bombs.len());
    let dir = folder();
    let wrong: Vec<String> = bombs.iter().filter_map(|bomb| fault(dir.path(), bomb)).collect();
    assert!(wrong.is_empty(), "{} of {} are wrong:\n{}", wrong.len(), bombs.len(), wrong.join("\n"));
}

#[test]
#[ignore = "slow: make test-all"]
fn four_times_the_rules_take_four_times_the_time_and_memory() {
    let _alone = ALONE.lock();
    let dir = folder();
    for (name, rule) in
        [("classes", ".c#{fill:red}"), ("types", "g x#{fill:red;stroke:none}"), ("layers", "@media all{.a#{fill:red}}")]
    {
        let [quarter, whole] = [250_000, 1_000_000].map(|n| taken(dir.path(), &bomb(name, numbered(rule, n))));
        for taken in [&quarter, &whole] {
            assert!(matches!(taken.code, Some(0..=2)), "{name}: {:?} {}", taken.code, taken.said);
        }
        let time = whole.processor / quarter.processor;
        let memory = whole.megabytes as f64 / quarter.megabytes.max(1) as f64;
        println!(
            "{name}: {:.2} s and {:.2} s, {} and {} MB",
            quarter.processor, whole.processor, quarter.megabytes, whole.megabytes
        );
        // A square would be sixteen.
        assert!(time < 7.0 && memory < 5.0, "{name}: {time:.1} times the time, {memory:.1} times the memory");
    }
}
