"""Which catalog models serve as what. Letters name libraries: S Scopia, K KatorLegaz, B BlendSwap CC-BY, Z its CC0."""

MODEL_KINDS = {
    "sofa": """S:beige_sofa S:beige_sofa_2seats S:burlap_sofa S:clear_sofa S:leather_sofa S:simple_sofa
        S:sofa_white_beige S:convertible-sofa-BZ-closed K:futon-couch K:mid-century-bench-sofa K:mid-century-sofa
        Z:couch Z:sofa2 Z:winchesterSofa B:couch3 B:sofa2 B:sofa3""",
    "corner_sofa": "Z:L_shaped_sofa Z:couch2 Z:sofa B:cornerSofa",
    "armchair": """S:armchair S:armchair1 S:armchair2 S:armchair3 S:modern_armchair S:puff K:mid-century-chair
        K:chair-ottoman Z:armchair2 Z:modernArmchair Z:winchesterArmchair Z:designChair B:armchair1 B:fotel
        B:leaf_chair B:armChair2""",
    "chair": """S:chair S:chair3 S:chair4 S:plastic_chair S:tubular_chair S:white_kitchen_chair K:dining-chair
        Z:antiqueChair Z:chair Z:chair2 Z:chairWithCushion Z:oakChair Z:osakaChair Z:plasticChair Z:sillaBlanca
        Z:thonet B:cafe_set_tonon_chair B:chair3 B:chair4 B:chairWithCushion B:ella_chair_f B:kitchenChair
        B:plaidChair K:cafe-chair B:foldingChair""",
    "dining_table": """S:black_table S:metal_glass_table S:table-on-trestles S:table-with-leaning-feet S:table4
        S:white_kitchen_table S:wooden_table_office S:desk_table K:folding-table K:glass-dining-table Z:table B:table
        S:wooden_office_alder_table S:glass_table_office S:wooden_office_pear_table_rect""",
    "round_table": "S:round-table Z:oakTable Z:tableWithTablecloth B:cafe_set_mota_table K:cafe-table",
    "coffee_table": """S:coffee-table2 S:coffee_table S:living_room_table S:saloon_table S:table_wood_and_iron
        B:coffeeTable K:trunk-large""",
    "tv_stand": "B:tvStand B:dresserWithDrawers S:box_room B:chest",
    "tv": "Z:led_tv S:wall-flat-tv S:tv",
    "wall_unit": "S:contemp_living_room S:dining_room Z:televisionCabinet S:office_furniture1 S:office_box",
    "bookcase": """Z:bookcase B:bookcase K:full-bookcase Z:shelves Z:verticalShelves K:utility-shelving
        S:kids_shelves""",
    "sideboard": """S:box_room B:dresserWithDrawers B:chest Z:cupboard S:changing-table B:piano S:fireplace1
        S:fireplace2""",
    "piano": "B:piano Z:pianoAQueue",
    "bed": "Z:bed1 Z:bed2 Z:bed3 Z:bedWithTexture B:lettoCloud S:bed1 S:iron_bed",
    "single_bed": """B:juniorBed S:captains-bed S:children_bed S:day_bed_frame B:bunkBed S:futon
        S:hospital-bed S:mezzanine-bed""",
    "crib": "Z:babyRockingBed S:crib",
    "bedside": "Z:bedsideTable2 B:bedsideTable K:filing-cabinet",
    "wardrobe": "Z:wardrobeWithSlidingDoors B:wardrobe B:wardrobe2 S:wardrobe1 Z:cupboard",
    "dresser": "S:dressing-table B:dresserWithDrawers B:chest S:clothes-rack",
    "desk": """Z:lbDesk B:biurko3 B:officeTable B:simpleDesk S:kids_desk_table S:kids_wooden_desk
        S:wooden_office_pear_table_rect S:wooden_office_alder_table S:wooden_table_office Z:desk""",
    "office_chair": "S:office_chair K:office-chair S:kids_desk_chair Z:armchair",
    "office_cupboard": "K:filing-cabinet S:office_box S:office_furniture1 Z:bookcase K:full-bookcase B:sef-kasa",
    "computer": "B:laptop S:apple_pc K:apple-ibook-2001 K:apple-imac-1998",
    "desk_thing": """S:penbox S:phone S:bandeja B:book S:inkjet_and_scanner_printer Z:kalender B:wirelessOfficePhone3
        S:tablet K:coffee-mug Z:tableFan Z:headphones""",
    "desk_lamp": "Z:desklamp S:desk_lamp1 S:desk_lamp2 B:lamp S:table_lamp",
    "table_lamp": "B:lamp S:little_lamp1 S:little_lamp2 S:table_lamp K:pedestal-vase-lamp S:livingroom_lamp1",
    "floor_lamp": "S:living_lamp",
    "pendant": "Z:lamp2 B:hangingLight K:hanging-restaurant-light S:saloon_lamp S:chandelier-lamp",
    "ceiling_lamp": "S:ceiling-lamp K:fluorescent Z:ceilingFan",
    "wall_lamp": "Z:wallLight K:wall-lamp-artwork K:porch-light",
    "plant": """Z:decorativePlant Z:plant B:mediumIndoorPlant B:spatifilum B:yuccaPlant S:ficus S:maceta
        B:decorativePlant""",
    "small_plant": """Z:augalas Z:cactus Z:littlePlant Z:orchids B:luckyBamboo B:spider_plant B:succulentPlant
        B:tulips S:bonsai-tree""",
    "vase": "S:jar S:vase1 S:vase2 S:vase3 S:vase5 S:pottery S:old_jar",
    "trinket": """S:candle S:complements2 Z:deer B:gift B:radio B:mp3Station B:book S:mini_stereo B:rubix2
        S:frame1 S:frame2 B:toyTrain Z:woodToy S:aquarium Z:speaker2 Z:cartoon_biplane K:newspaper""",
    "tableware": """S:ensemble-assiette-couteau-fourchette-cuillere-verre K:plate-and-ustensils S:bowlWithFruits
        S:bowlWithSalad S:tray S:apples K:bowl S:cup B:coffee_cup Z:bread S:wine_bottle S:birthday_cake S:teapot
        B:glass S:sushi_tray""",
    "rug": "K:oriental-rug S:round-carpet",
    "kitchen_low": """Z:drawersCabinet Z:lowerCabinet B:kitchenDrawersCabinet B:kitchenLowerCabinet
        B:kitchenSmallLowerCabinet""",
    "kitchen_sink": "Z:sinkCabinet B:kitchenSink",
    "kitchen_stove": "B:largeStove",
    "kitchen_tall": "Z:largeFridge Z:refrigerator Z:highCabinet K:fridge Z:doubleOven",
    "kitchen_up": "Z:upperCabinet Z:glassDoorCabinet B:kitchenUpperCabinet B:kitchenSmallUpperCabinet",
    "kitchen_hood": "Z:rangeHood B:hood",
    "kitchen_island": "B:kitchenIsland Z:islandExtension",
    "kitchen_thing": """Z:coffeeBrewer Z:kitchenaid B:breadBox B:coffeePress K:coffee-maker B:microwave S:toaster
        S:kitchenKnifeStandSet B:kitchenScale B:choppingBoard B:utensilsPot S:paperTowelHolder S:spiceTower S:cooker
        B:boiler B:espressokettle Z:tetrapak S:small-oven""",
    "bar_stool": "Z:stool Z:stool2 Z:silla2 S:bar_chair S:kitchen_stool K:bar-stool",
    "washer": "B:washing_machine S:clothes_washing_machine S:dryer_machine",
    "toilet": "Z:toiletsUnit B:modernToilet B:toilets_unit_jay_hardy",
    "bidet": "Z:bidet",
    "washbasin": """Z:modernVanity Z:washbasin B:washbasin_jay_hardy S:bathroom_vanity S:double_vanity
        S:bathroom3""",
    "bath": "B:bath_jay_hardy S:islandBath S:corner_bathtub",
    "shower": "Z:showerStall",
    "bath_wall": "Z:towel3 S:com_bath3 B:bathroomRadiator B:radiatorAndTowels K:towel-rack",
    "bath_floor": "S:clothes-basket Z:toiletBrush K:bathmat Z:dustbin B:sef-kasa",
    "radiator": "Z:radiator Z:radiator1 Z:radiator3 B:modernRadiator",
    "bin": "Z:dustbin K:recycling-bin K:bullet-trash-can",
    "toy": "S:doll-house Z:caballito S:tricycle Z:basketball B:ballonFoot Z:teddyBear S:children_table B:childChair",
    "floor_thing": """S:cardboard-box S:open-cardboard-box B:backpack B:suitcase Z:crate K:trunk-large Z:ammoBox
        S:sneakers Z:slippers Z:speaker3 Z:umbrellaFolded Z:electricGuitar S:clothes-basket S:puff B:green_stool
        S:shopping-basket K:recycling-bin""",
    "store": """S:cardboard-box S:open-cardboard-box Z:crate Z:barrel B:workbench S:step-ladder-wood B:bike S:bicycle
        K:utility-shelving S:electric_water_heater_big S:chest-freezer B:suitcase S:wood_logs S:stroller Z:ammoBox
        S:clothes-horse S:furnace""",
    "sport": "B:treadmill S:indoor-bike B:abdominalBench B:fitnessTower S:punching-ball",
    "game": "B:table_tennis Z:poolTable Z:table_football S:flipper",
    "board": "Z:whiteBoard",
    "screen": "S:japanese_style_screen",
    "bench": "K:bench Z:pianoBench Z:bench K:painted-bench",
    "pet": "S:cat S:dog B:bulldog B:siameseCat S:rabbit",
    "wall_thing": "S:internal-unity-air-conditioning Z:cuckooClock S:wall-hanger S:dart_game",
    "clothes": "K:hanging-clothes1",
}
