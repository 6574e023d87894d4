//! What a surface is: the label set of Cityscapes (Cordts et al. 2016), ids as in its published label table.

/// Declares the labels with id, training id and name.
macro_rules! classes {
    ($($(#[$doc:meta])* $variant:ident = $id:literal, $train:literal, $name:literal;)+) => {
        /// Semantic class of a surface, numbered with the ids of Cityscapes.
        #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default)]
        #[repr(u8)]
        pub enum SemanticClass {
            $($(#[$doc])* $variant = $id,)+
        }

        impl SemanticClass {
            /// All classes, by id.
            pub const ALL: &[Self] = &[$(Self::$variant),+];

            /// The class with an id of Cityscapes.
            pub fn from_id(id: u8) -> Option<Self> {
                match id {
                    $($id => Some(Self::$variant),)+
                    _ => None,
                }
            }

            /// Name in Cityscapes' table.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name,)+
                }
            }

            /// Id among the 19 classes that are trained and scored, `None` for those left out.
            pub fn train_id(self) -> Option<u8> {
                let id: u8 = match self {
                    $(Self::$variant => $train,)+
                };
                (id != 255).then_some(id)
            }
        }
    };
}

classes! {
    /// Nothing known.
    #[default]
    Unlabeled = 0, 255, "unlabeled";
    /// Part of the vehicle that carries the camera.
    EgoVehicle = 1, 255, "ego vehicle";
    /// Things that stand: bins, boxes, benches.
    Static = 4, 255, "static";
    /// Things that move and are nothing else.
    Dynamic = 5, 255, "dynamic";
    /// Ground that is none of the others.
    Ground = 6, 255, "ground";
    /// Where cars drive, with its markings.
    Road = 7, 0, "road";
    /// Where people walk, with its kerb.
    Sidewalk = 8, 1, "sidewalk";
    /// Parking places.
    Parking = 9, 255, "parking";
    /// Rail tracks.
    RailTrack = 10, 255, "rail track";
    /// Houses.
    Building = 11, 2, "building";
    /// Walls that stand alone.
    Wall = 12, 3, "wall";
    /// Fences.
    Fence = 13, 4, "fence";
    /// Guard rails.
    GuardRail = 14, 255, "guard rail";
    /// Bridges.
    Bridge = 15, 255, "bridge";
    /// Tunnels.
    Tunnel = 16, 255, "tunnel";
    /// Poles, of signs and lights too.
    Pole = 17, 5, "pole";
    /// Heads of traffic lights.
    TrafficLight = 19, 6, "traffic light";
    /// Faces of traffic signs.
    TrafficSign = 20, 7, "traffic sign";
    /// Trees, hedges.
    Vegetation = 21, 8, "vegetation";
    /// Grass, soil, sand.
    Terrain = 22, 9, "terrain";
    /// The open sky.
    Sky = 23, 10, "sky";
    /// People on their feet.
    Person = 24, 11, "person";
    /// People on two wheels.
    Rider = 25, 12, "rider";
    /// Cars, vans.
    Car = 26, 13, "car";
    /// Trucks.
    Truck = 27, 14, "truck";
    /// Buses.
    Bus = 28, 15, "bus";
    /// Caravans.
    Caravan = 29, 255, "caravan";
    /// Trailers.
    Trailer = 30, 255, "trailer";
    /// Trains, trams.
    Train = 31, 16, "train";
    /// Motorcycles without their rider.
    Motorcycle = 32, 17, "motorcycle";
    /// Bicycles without their rider.
    Bicycle = 33, 18, "bicycle";
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_and_names_are_those_of_the_table() {
        for &class in SemanticClass::ALL {
            assert_eq!(SemanticClass::from_id(class as u8), Some(class));
        }
        assert_eq!(SemanticClass::from_id(99), None);
        assert_eq!((SemanticClass::Car as u8, SemanticClass::Car.train_id()), (26, Some(13)));
        assert_eq!(SemanticClass::GuardRail.train_id(), None);
        let mut trained: Vec<u8> = SemanticClass::ALL.iter().filter_map(|c| c.train_id()).collect();
        trained.sort_unstable();
        assert_eq!(trained, (0..19).collect::<Vec<u8>>());
        assert_eq!(SemanticClass::TrafficLight.name(), "traffic light");
    }
}
