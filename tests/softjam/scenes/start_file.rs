//! Start files that are no packing: the message names the file, the line and what stands there.

use softjam::domain::Vec2;
use softjam::protocol::Relaxation;
use softjam::scene::start::{StartFile, read_csv};
use softjam::scene::{Preparation, Scene, SceneError, Start};
use softjam::state::Packing;

/// What a scene that starts from a file of these bytes says.
fn complaint(bytes: &[u8]) -> String {
    let folder = crate::common::Folder::new();
    let path = folder.path().join("start.csv");
    std::fs::write(&path, bytes).unwrap();
    let path = path.to_str().unwrap();
    let scene = Scene {
        start: Start::File {
            path: path.into(),
            blake3: None,
            preparation: Preparation::AsItStands,
        },
        ..Scene::default()
    };
    let message = match Relaxation::new(&scene) {
        Ok(_) => panic!("{:?} passed", String::from_utf8_lossy(bytes)),
        Err(error) => error.to_string(),
    };
    assert!(
        message.starts_with(&format!("start file {path}")),
        "{message}"
    );
    assert!(!message.contains("line 0"), "{message}");
    message
}

/// The packing in a file of this text, as a run that starts from it as it stands would have it.
fn of(text: &str) -> Result<Packing, SceneError> {
    let folder = crate::common::Folder::new();
    let path = folder.path().join("start.csv");
    std::fs::write(&path, text).unwrap();
    let (packing, _) = StartFile::read(&path)?.prepared(Preparation::AsItStands)?;
    Ok(packing)
}

fn prepared(text: &str, preparation: Preparation) -> Packing {
    let folder = crate::common::Folder::new();
    let path = folder.path().join("start.csv");
    std::fs::write(&path, text).unwrap();
    StartFile::read(&path)
        .unwrap()
        .prepared(preparation)
        .unwrap()
        .0
}

/// A table with a file a line, ` / ` for the end of a line; then `=>`, then what the message must hold, ` & ` between
/// the parts.
#[track_caller]
fn assert_all_refused(before: &str, table: &str, after: &str) {
    for row in table.lines().filter(|row| !row.trim().is_empty()) {
        let (text, words) = row.split_once("=>").expect("a row has two columns");
        let file = format!("{before}{}{after}", text.trim().replace(" / ", "\n"));
        let message = complaint(file.as_bytes());
        for word in words.split(" & ").map(str::trim) {
            assert!(
                message.contains(word),
                "{file:?}: no `{word}` in: {message}"
            );
        }
    }
}

#[test]
fn well_formed_start_file_is_read_and_wrapped() {
    let folder = crate::common::Folder::new();
    let path = folder.path().join("start.csv");
    let text =
        "# made by hand\n# box = 6.5, 7\n x , y , radius\n# a comment\n-1, 8.5, 0.5\n2,1,0.7\n";
    std::fs::write(&path, text).unwrap();
    let packing = read_csv(path.to_str().unwrap(), None).unwrap();
    assert_eq!(packing.domain().lengths(), Vec2::new(6.5, 7.0));
    assert_eq!(
        packing.positions(),
        [Vec2::new(5.5, 1.5), Vec2::new(2.0, 1.0)]
    );
    assert_eq!(packing.radii(), [0.5, 0.7]);
}

#[test]
fn box_that_is_missing_or_no_rectangle_is_quoted_with_its_line() {
    assert_all_refused(
        "",
        "
                                            => # box = L_x, L_y
        # a packing                         => # box = L_x, L_y
        # box = 6                           => line 1 & `# box = 6`
        # box = -6, 6                       => line 1 & `# box = -6, 6`
        # box = 0, 6                        => line 1 & `# box = 0, 6`
        # box = nan, 6                      => line 1 & `# box = nan, 6`
        # box = inf, 6                      => line 1 & `# box = inf, 6`
        # box = wide, high                  => line 1 & `# box = wide, high`
        # box = 6, 6, 6                     => line 1 & `# box = 6, 6, 6`
        # a packing / # box = 6; 6          => line 2 & `# box = 6; 6`
        ",
        "\nx,y,radius\n1,1,0.5\n3,1,0.5\n",
    );
    assert!(complaint(b"").contains("# box = L_x, L_y"));
}

#[test]
fn box_comment_with_a_word_among_its_numbers_is_refused() {
    assert_all_refused(
        "",
        "
        # box = 6, wide, 6                  => line 1 & `# box = 6, wide, 6`
        # box = 6, 6, deep                  => line 1 & `# box = 6, 6, deep`
        ",
        "\nx,y,radius\n1,1,0.5\n",
    );
}

#[test]
fn header_that_is_missing_or_another_is_quoted() {
    assert_all_refused(
        "# box = 6, 6\n",
        "
                                            => `x,y,radius`
        x,y,r / 1,1,0.5                     => `x,y,r` & `x,y,radius`
        radius,x,y / 1,1,0.5                => `radius,x,y`
        x,y / 1,1                           => `x,y` & `x,y,radius`
        # radius,x,y / 1,1,0.5              => line 3: `1,1,0.5` & `x,y,radius` (or `x,y,diameter`)
        # x,y,d / x,y,radius / 1,1,0.5      => line 2: `# x,y,d` here and `x,y,radius` on line 3 name different columns
        # x,y,radius / # x,y,d / 1,1,0.5    => line 2: `# x,y,radius` here and `# x,y,d` on line 3 name different columns
        # x,y,radius                        => no header `x,y,radius` with a particle below it
        1,1,0.5                             => `1,1,0.5`
        ",
        "\n",
    );
}

#[test]
fn rows_that_are_no_particle_are_named() {
    assert_all_refused(
        "# box = 6, 6\nx,y,radius\n",
        "
                                            => 0 particles
        1,1,0.5 / 2,one,0.5                 => line 4 & three numbers x,y,radius
        1,1,0.5 / 2,,0.5                    => line 4 & three numbers x,y,radius
        1,1,0.5 / 2,1                       => line 4
        1,1,0.5 / 2,1,0.5,7                 => line 4
        1,1,0.5 /  / # two / 2,one,0.5      => line 6 & `2,one,0.5` is not three numbers x,y,radius
        1,1,-0.5                            => line 3 & radius -0.5 of particle 0
        1,1,0.5 /  / 3,1,0                  => line 5 & radius 0 of particle 1
        1,1,nan                             => radius NaN of particle 0
        1,1,inf                             => radius inf of particle 0
        1,1,0.5 / 3,nan,0.5                 => position (3, NaN) of particle 1
        inf,1,0.5                           => position (inf, 1) of particle 0
        1,1,4                               => line 1: its phi = 1.39 & 0 < phi < 1.3 & phi is 0.3491: call it `diameter`
        1,1,3.1                             => line 3: particle 0 of radius 3.1 is wider than the box of 6.0000 × 6.0000
        ",
        "\n",
    );
}

#[test]
fn file_that_is_no_text_is_refused() {
    let message = complaint(b"# box = 6, 6\nx,y,radius\n1,1,\xff\n");
    assert!(
        message.contains("line 3: byte 28 is not UTF-8"),
        "{message}"
    );
    assert!(complaint(&[0; 100]).contains("line 1: byte 0 is 0, which no text holds"));
    assert!(complaint(b"# box\n\0").contains("line 2: byte 6 is 0"));
}

#[test]
fn two_boxes_are_refused_with_both_lines() {
    assert_all_refused(
        "",
        "
        # box = 8, 8 / # box = 6, 6         => line 2: two boxes, `# box = 8, 8` on line 1 and `# box = 6, 6` on line 2
        # box = 6, 6 / x,y,radius / 1,1,0.5 / # box = 6, 6 / 2,2,0.5 => line 4: two boxes & on line 1
        ",
        "\nx,y,radius\n1,1,0.5\n3,1,0.5\n",
    );
}

#[test]
fn numbers_without_digits_left_are_refused_with_line_and_value() {
    assert_all_refused(
        "# box = 8, 8\nx,y,radius\n",
        "
        1,1,0.5 / 1e17,1,0.5                => line 4: x = 1e17 of particle 1 has no digits left & 2.2e1 apart & radius is 0.5
        1,-3e11,0.5                         => line 3: y = -3e11 of particle 0 & 6.7e-5 apart
        1e10,1,0.5                          => line 3: x = 1e10 of particle 0
        ",
        "\n",
    );
    assert_all_refused(
        "",
        "
        # box = 1e17, 8 / x,y,radius / 1,1,0.5 => line 1: numbers of the size of a side, 1e17, are 2.2e1 apart & radius 0.5
        ",
        "\n",
    );
    // A coordinate that was never wrapped keeps its digits over a billion boxes.
    let text = "# box = 8, 8\nx,y,radius\n8e8,-799999996,0.5\n4,0,0.5\n";
    assert_eq!(of(text).unwrap().positions()[0], Vec2::new(0.0, 4.0));
}

#[test]
fn particles_on_one_point_are_refused_with_both_lines_and_the_way_out() {
    assert_all_refused(
        "# box = 8, 6\nx,y,radius\n",
        "
        1,2,0.5 / 1,2,0.7                   => line 4: particle 1 (line 4, at 1, 2) stands on the point of particle 0 (line 3, at 1, 2), and nothing says in which direction they part & --separate & --relax-disks
        0,2,0.5 / 4,2,0.5 / 8,2,0.5         => line 5: particle 2 (line 5, at 8, 2) is the periodic copy of particle 0 (line 3, at 0, 2), and
        0,0,0.5 / 4,2,0.5 / # / 8,6,0.5     => line 6: particle 2 (line 6, at 8, 6) is the periodic copy of particle 0
        0,2,0.5 / 7.9999,2,0.5              => line 4: particle 1 (line 4, at 7.9999, 2) is the periodic copy of particle 0
        -1,2,0.5 / 7,2,0.5 / 15,2,0.5       => line 4: particle 1 (line 4, at 7, 2) is the periodic copy & (and 1 more such)
        ",
        "\n",
    );
    // Two hundredths of a radius apart have a direction.
    let text = "# box = 8, 6\nx,y,radius\n0,2,0.5\n7.99,2,0.5\n";
    assert_eq!(of(text).unwrap().len(), 2);
}

#[test]
fn separated_particles_have_the_seats_of_a_sunflower_and_the_others_stay() {
    let text = "# box = 20, 20\nx,y,radius\n3,3,0.5\n10,10,0.7\n10,10,0.5\n16,4,0.5\n10,10,0.7\n";
    let packing = prepared(text, Preparation::Separated);
    let p = packing.positions();
    assert_eq!((p[0], p[3]), (Vec2::new(3.0, 3.0), Vec2::new(16.0, 4.0)));
    let golden = std::f64::consts::PI * (3.0 - 5.0f64.sqrt());
    let mut within = 0.0;
    for (k, (particle, radius)) in [(1, 0.7), (2, 0.5), (4, 0.7)].into_iter().enumerate() {
        let distance = f64::sqrt(within + radius * radius / 2.0);
        let (sin, cos) = (golden * k as f64).sin_cos();
        let seat = Vec2::new(10.0 + distance * cos, 10.0 + distance * sin);
        assert!((p[particle] - seat).norm() < 1e-14);
        within += radius * radius;
    }
    // No two overlap by more than a third of their radii.
    for (i, j) in [(1, 2), (1, 4), (2, 4)] {
        let sum = packing.radii()[i] + packing.radii()[j];
        assert!(packing.separation(i, j).norm() > 2.0 / 3.0 * sum);
    }
    assert_eq!(
        packing,
        prepared(text, Preparation::Relaxed),
        "relaxed by the run"
    );
}

#[test]
fn diameters_are_halved_and_a_header_may_be_a_comment() {
    let rows = "1,1,1\n2.5,1,1.4\n";
    for header in [
        "x,y,diameter",
        "x,y,d",
        "# x,y,diameter",
        "#x, y ,d",
        "## x,y,d",
    ] {
        let packing = of(&format!("# box = 6, 6\n{header}\n{rows}")).unwrap();
        assert_eq!(packing.radii(), [0.5, 0.7], "{header}");
    }
    for header in [
        "x,y,radius",
        "# x,y,radius",
        "# x,y,radius\n# made by hand",
        "# x,y,radius\n\nx,y,radius",
    ] {
        let packing = of(&format!("{header}\n{rows}# box = 9, 9\n")).unwrap();
        assert_eq!(packing.radii(), [1.0, 1.4], "{header}");
    }
    assert_all_refused(
        "# box = 6, 6\n# x,y,diameter\n",
        "
        1,1,1 / 2,1,-1                      => line 4: diameter -1 of particle 1 is not a positive, finite length
        1,1,one                             => line 3: `1,1,one` is not three numbers x,y,diameter
        1,1,1,1                             => line 3: `1,1,1,1` is not three numbers
        1,1,8                               => line 1: its phi = 1.396
        ",
        "\n",
    );
    // What is said of diameters in a column that is called so makes no sense.
    let message = complaint(b"# box = 6, 6\nx,y,diameter\n1,1,8\n");
    assert!(!message.contains("holds diameters"), "{message}");
}

#[test]
fn boxes_may_be_narrow_and_particles_large_where_no_pair_meets_twice() {
    // The largest radius is nearly half a side: five times of it are not asked for.
    for text in [
        "# box = 20, 2.4\nx,y,radius\n1,1,0.5\n3,1,0.5\n5,1,0.5\n",
        "# box = 20, 20\nx,y,radius\n10,10,8\n1,1,0.5\n19,2,0.5\n",
        "# box = 6, 1.2\nx,y,radius\n1,1,0.5\n",
    ] {
        let scene_of = |text: &str| {
            let packing = of(text).unwrap();
            let run = Relaxation::of_start(&Scene::default(), packing).unwrap();
            run.contacts().pairs.to_vec()
        };
        assert_eq!(scene_of(text), [[0u32; 2]; 0]);
    }
    // A pair that does meet twice has no answer.
    let twice = "# box = 20, 1.9\nx,y,radius\n1,0,0.5\n1,0.95,0.5\n";
    let error = Relaxation::of_start(&Scene::default(), of(twice).unwrap()).unwrap_err();
    let told = "step 0: particle 0 touches particle 1 across more than one side of the box";
    assert!(error.to_string().starts_with(told), "{error}");
}

#[test]
fn file_that_is_missing_is_named() {
    let scene = Scene::from_toml("file = \"no/such/packing.csv\"").unwrap();
    let error = Relaxation::new(&scene).unwrap_err().to_string();
    let start = "cannot read no/such/packing.csv: ";
    assert!(error.starts_with(start), "{error}");
}

#[test]
fn file_with_another_hash_is_refused() {
    let folder = crate::common::Folder::new();
    let path = folder.path().join("start.csv");
    std::fs::write(&path, "# box = 6, 6\nx,y,radius\n1,1,0.5\n").unwrap();
    let path = path.to_str().unwrap();
    let error = read_csv(path, Some("00ff")).unwrap_err();
    assert!(matches!(error, SceneError::StartFile { .. }));
    let error = error.to_string();
    assert!(error.contains("00ff") && error.contains(path), "{error}");
}
