#[path = "../tests/support/surfaces.rs"]
mod surfaces;
use std::time::Instant;
fn main() {
    let n: usize = std::env::args().nth(1).unwrap().parse().unwrap();
    let method = std::env::args().nth(2).unwrap();
    let pitch = std::env::args().nth(3).unwrap();
    let dir = std::env::temp_dir().join("try"); std::fs::create_dir_all(&dir).unwrap();
    let stl = dir.join(format!("dome{n}.stl"));
    if !stl.exists() { surfaces::write_stl(&stl, &surfaces::mesh(n, [0.0,0.0,450.0,450.0], surfaces::dome)); }
    let toml = format!("[surface]\nfile=\"dome{n}.stl\"\nunit=\"mm\"\n[[texture]]\npattern=\"hatch\"\npitch=\"{pitch} mm\"\n[focus]\npdof=\"0.07 mm\"\n[partition]\nmethod=\"{method}\"\n[machine]\nprofile=\"xyz-galvo-40\"\n[[pen]]\nname=\"a\"\nspeed=\"1000 mm/s\"\npower=\"60 %\"\nfrequency=\"60 kHz\"\n");
    let job = terrace::spec::Job::parse(&dir.join("job.toml"), &toml).unwrap_or_else(|e| panic!("{e}"));
    let t = Instant::now();
    let plan = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap().install(|| terrace::compile::plan(job, &|s| eprintln!("{:?} {:?}", t.elapsed(), s))).unwrap_or_else(|e| panic!("{e}"));
    eprintln!("{:?}", t.elapsed());
    println!("{}", serde_json::to_string_pretty(&plan.summary).unwrap());
}
