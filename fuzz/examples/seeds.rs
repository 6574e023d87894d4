//! Writes what the fuzz targets begin with into a folder: `seeds FOLDER`.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex};

use anyhow::Context as _;
use swerve_drive::{drive_pipeline, run_start};
use swerve_flow::{Answered, Call, Event, Lost, Observer, RemoteExecutor, Worker};
use swerve_fuzz::WORKERS;
use swerve_localization::map_file::MapFile;
use swerve_localization::voxels::Voxel;
use swerve_log::Recorder;
use swerve_measure::picture::Picture;
use swerve_ros2::{Kind, cdr, samples};
use swerve_stack::Setup;

fn main() -> anyhow::Result<()> {
    let folder = std::env::args().nth(1).context("expected a folder")?;
    let folder = Path::new(&folder);
    copied(folder)?;
    for (k, kind) in Kind::ALL.iter().enumerate() {
        let payload = cdr::encode(&samples::sample(*kind));
        put(folder, "cdr", kind.name(), &[&[k as u8], &payload[..]].concat())?;
    }
    driven(folder)
}

/// Files of the repository: each target begins with those that it is for.
fn copied(folder: &Path) -> anyhow::Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let of = [
        ("scenario", "scenarios", "toml"),
        ("config", "configs", "toml"),
        ("config", "configs/live", "toml"),
        ("study", "configs/studies", "toml"),
        ("plan_problems", "configs/problems", "json"),
        ("detector_weights", "crates/swerve-vision/detectors", "weights"),
        ("segmentation_weights", "crates/swerve-vision/segmentations", "weights"),
        ("prediction_weights", "crates/swerve-prediction/weights", "weights"),
        ("commonroad", "crates/swerve-commonroad/src/read/tests", "xml"),
        ("lanelets", "crates/swerve-map-io/src/commonroad/tests", "xml"),
        ("lanelet2", "crates/swerve-map-io/maps", "osm"),
        ("lidar_weights", "crates/swerve-perception/src/lidar", "txt"),
        ("opendrive", "crates/swerve-map-io/maps", "xodr"),
        ("sumo", "crates/swerve-map-io/maps", "xml"),
    ];
    for (target, from, ending) in of {
        for entry in std::fs::read_dir(root.join(from)).with_context(|| from.to_owned())? {
            let path = entry?.path();
            if path.extension().is_some_and(|end| end == ending) {
                let name = path.file_name().context("a file has a name")?.to_string_lossy().into_owned();
                put(folder, target, &name, &std::fs::read(&path)?)?;
            }
        }
    }
    let mot = "1,1,10,10,20,40,1,-1,-1,-1\n2,1,12,10,20,40,1,-1,-1,-1\n---\n1,7,11,10,20,40,1,-1,-1,-1\n";
    let kitti = "Car 0.00 0 1.57 10 20 60 80 1.5 1.6 4.0 1.0 1.5 20.0 1.57\n---\n\
                 Car -1 -1 1.57 11 20 60 80 1.5 1.6 4.0 1.0 1.5 20.0 1.57 0.9\n";
    let coco = "{\"images\":[{\"id\":1}],\"categories\":[{\"id\":1,\"name\":\"car\"}],\"annotations\":[{\"id\":1,\
                \"image_id\":1,\"category_id\":1,\"bbox\":[1,2,30,40],\"area\":1200,\"iscrowd\":0}]}\n---\n\
                [{\"image_id\":1,\"category_id\":1,\"bbox\":[1,2,30,41],\"score\":0.9}]";
    let picture = Picture { size: [5, 3], bytes: (0..45).collect() };
    std::fs::create_dir_all(folder.join("png"))?;
    picture.write(&folder.join("png/small.png"))?;
    // The target puts the first two bytes there.
    let photo = swerve_foxglove::jpeg(&[120; 16 * 8 * 3], 16, 8, 80).context("an image of a size")?;
    put(folder, "jpeg", "small", &photo[2..])?;
    put(folder, "mot", "two", mot.as_bytes())?;
    put(folder, "kitti", "one", kitti.as_bytes())?;
    let cloud = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n\
                 1 2 3\n4 5 6\n";
    put(folder, "clouds", "points", cloud.as_bytes())?;
    put(folder, "clouds", "map", &MapFile::new(1.0, floor()).write())?;
    put(folder, "npz", "drive", &npz())?;
    let walks = (0..12).map(|k| format!("{0} 1 {1} 0\n{0} 2 0 {1}\n", 10 * k, 0.4 * f64::from(k)));
    put(folder, "tracks", "eth_ucy", walks.collect::<String>().as_bytes())?;
    put(folder, "tracks", "commonroad_csv", swerve_fuzz::recording().as_bytes())?;
    // `printf '0 1 2 3\n' | gzip -n`
    let packed = b"\x1f\x8b\x08\0\0\0\0\0\0\x033P0T0R0\xe6\x02\0\x60\xb4\x64\x57\x08\0\0\0";
    put(folder, "tracks", "gzip", packed)?;
    put(folder, "coco", "one", coco.as_bytes())?;
    let routes = "{\"cases\":[{\"name\":\"a\",\"route_length_m\":900,\"route_completion\":100,\"counts\":{\"red_light\":1},\
                  \"min_speed_checkpoints_percent\":[80.5],\"expect\":{\"2.x\":{\"penalty\":0.7}}},{\"name\":\"b\",\
                  \"routes\":[{\"route\":\"a\"}]}],\"counting\":{\"events\":[[1,\"vehicle\",7,0,5]]}}";
    put(folder, "scores", "two", routes.as_bytes())?;
    put(folder, "ros2_mapping", "some", b"vehicle = \"autoware\"\n[topics.pose]\ntopic = \"/x\"\n")
}

/// Voxels of a floor.
fn floor() -> Vec<Voxel> {
    let voxel = |k: i32| Voxel {
        index: [k % 7 * 2, k / 7 * 2, 0],
        count: 9,
        mean_m: [0.1, 0.2, 0.0],
        covariance_m2: [0.1, 0.0, 0.0, 0.1, 0.0, 0.001],
    };
    (0..49).map(voxel).collect()
}

/// A drive straight on, of a tenth of a second, in an archive of arrays as NumPy writes it.
fn npz() -> Vec<u8> {
    let rows = |columns: usize, number: fn(usize, usize) -> f64| {
        let each = (0..20).flat_map(|k| (0..columns).map(move |axis| number(k, axis)));
        (columns, each.collect::<Vec<f64>>())
    };
    let (t, at) =
        (rows(1, |k, _| 0.005 * k as f64), rows(3, |k, axis| if axis == 0 { 0.05 * k as f64 } else { 0.0 }));
    let speed = rows(3, |_, axis| if axis == 0 { 10.0 } else { 0.0 });
    let (rest, gravity) = (rows(3, |_, _| 0.0), rows(3, |_, axis| if axis == 2 { 9.81 } else { 0.0 }));
    let arrays = [
        ("imu_f.data", &gravity),
        ("imu_f.t", &t),
        ("imu_w.data", &rest),
        ("gnss.data", &at),
        ("gnss.t", &t),
        ("lidar.data", &at),
        ("lidar.t", &t),
        ("gt.p_init", &at),
        ("gt.v", &speed),
        ("gt.r_init", &rest),
    ];
    let long = |n: usize| (n as u32).to_le_bytes();
    let (mut members, mut directory) = (Vec::new(), Vec::new());
    for (name, (columns, numbers)) in arrays {
        let shape = if *columns == 1 { "(20,)" } else { "(20, 3)" };
        let head = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}\n");
        let array: Vec<u8> = [b"\x93NUMPY\x01\0", &(head.len() as u16).to_le_bytes()[..], head.as_bytes()]
            .concat()
            .into_iter()
            .chain(numbers.iter().flat_map(|x| x.to_le_bytes()))
            .collect();
        // Not packed, of no date, its checksum to be put in, no bytes beside its name.
        let [size, length] = [long(array.len()), long(name.len())];
        let same = [&[0; 10][..], &size, &size, &length].concat();
        directory.extend(
            [b"PK\x01\x02\x14\0\x14\0\0\0", &same[..], &[0; 10], &long(members.len()), name.as_bytes()]
                .concat(),
        );
        members.extend([b"PK\x03\x04\x14\0\0\0", &same[..], name.as_bytes(), &array].concat());
    }
    let count = (arrays.len() as u16).to_le_bytes();
    let sizes = [long(directory.len()), long(members.len())].concat();
    let end = [b"PK\x05\x06\0\0\0\0", &count[..], &count, &sizes, &[0; 2]].concat();
    swerve_fuzz::zip_with_checksums([members, directory, end].concat())
}

/// Log, messages and calls of a short drive in several processes.
fn driven(folder: &Path) -> anyhow::Result<()> {
    let mut pipeline = swerve_fuzz::pipeline();
    let calls: Arc<Mutex<Vec<Vec<u8>>>> = Arc::default();
    for operator in WORKERS {
        let worker = swerve_fuzz::pipeline().graph.into_worker(&[operator.to_owned()])?;
        let asked = Asked { worker, calls: calls.clone() };
        let _remote = pipeline.graph.operator(operator)?.remote(Box::new(asked));
    }
    let log = swerve_fuzz::Scratch::file("log.mcap", &[]);
    let start = run_start(&Setup::default(), &pipeline.scenario, Path::new("person_behind_truck"));
    let mut recorder = Recorder::create(log.path(), &start)?;
    let mut messages = Messages::default();
    drive_pipeline(pipeline, 1, 1, &mut [&mut messages, &mut recorder])?;
    recorder.finish()?;
    put(folder, "log", "drive", &std::fs::read(log.path())?)?;
    put(folder, "rosbag", "drive", &std::fs::read(log.path())?)?;
    for (stream, [wire, cbor]) in &messages.0 {
        put(folder, "message", &format!("{stream}.wire"), wire)?;
        put(folder, "message", &format!("{stream}.cbor"), cbor)?;
    }
    for (k, call) in calls.lock().expect("no thread has panicked").iter().enumerate().step_by(7) {
        put(folder, "worker_call", &k.to_string(), call)?;
    }
    Ok(())
}

/// Keeps the calls, and has them answered here.
struct Asked {
    worker: Worker,
    calls: Arc<Mutex<Vec<Vec<u8>>>>,
}

impl RemoteExecutor for Asked {
    fn step(&mut self, call: &Call<'_>, answer: &mut Vec<u8>) -> Result<Answered, Lost> {
        let mut bytes = Vec::new();
        call.encode(&mut bytes);
        self.worker.answer(&bytes, answer).map_err(|error| Lost(error.to_string()))?;
        self.calls.lock().expect("no thread has panicked").push(bytes);
        Ok(Answered::InTurn)
    }
}

/// One message of each stream, between processes and in a log.
#[derive(Default)]
struct Messages(BTreeMap<String, [Vec<u8>; 2]>);

impl Observer for Messages {
    fn event(&mut self, event: &Event<'_>) {
        let Event::Publication(publication) = event else { return };
        let Some(payload) = publication.payload else { return };
        let [wire, cbor] = self.0.entry(publication.stream.to_owned()).or_default();
        wire.clear();
        cbor.clear();
        payload.to_wire(wire);
        payload.to_cbor(cbor);
    }
}

fn put(folder: &Path, target: &str, name: &str, bytes: &[u8]) -> anyhow::Result<()> {
    // Whole images and clouds slow every run of a target down and say nothing new.
    const BYTES_MAX: usize = 200_000;
    let folder = folder.join(target);
    std::fs::create_dir_all(&folder)?;
    if bytes.len() <= BYTES_MAX || target == "log" || target.ends_with("weights") {
        std::fs::write(folder.join(name), bytes)?;
    }
    Ok(())
}
