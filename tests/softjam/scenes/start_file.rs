//! Start files that are no packing: the message names the file, the line and what stands there.

use softjam::domain::Vec2;
use softjam::relax::Relaxation;
use softjam::scene::start::read_csv;
use softjam::scene::{Scene, SceneError, Start};

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
        1,1,4                               => phi = 1.39 & 0 < phi < 1.3
        1,1,1.5                             => largest radius 1.5 & 6.0000 × 6.0000
        ",
        "\n",
    );
}

#[test]
fn file_that_is_no_text_is_refused() {
    let message = complaint(b"# box = 6, 6\nx,y,radius\n1,1,\xff\n");
    assert!(message.contains("UTF-8"), "{message}");
    assert!(complaint(&[0; 100]).contains("byte 0 is 0, which no text holds"));
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
